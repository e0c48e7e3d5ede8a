/* What experiment.c needs of the robot: define these two in a file of your own. Units are those of the campaign. */
#ifndef EXPERIMENT_H
#define EXPERIMENT_H

#include "{{ name }}.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bring the robot to rest where the task starts, and measure: y, the inputs u under which it rests{{ ", the disturbances w" if disturbances else "" }}. Returns 0, or
 * anything else when that failed. */
int robot_start(real y[{{ NAME }}_OUTPUTS], real u[{{ NAME }}_INPUTS]{{ ", real w[%s_DISTURBANCES]" % NAME if disturbances else "" }});

/* Apply u, wait until {{ NAME }}_SAMPLE_TIME seconds after the last measurement, and measure. Returns 0, or anything else to end
 * the experiment at once. */
int robot_hold(const real u[{{ NAME }}_INPUTS], real y[{{ NAME }}_OUTPUTS]{{ ", real w[%s_DISTURBANCES]" % NAME if disturbances else "" }});

#ifdef __cplusplus
}
#endif

#endif
