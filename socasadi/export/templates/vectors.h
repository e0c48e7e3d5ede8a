/* A recorded episode, then random samples that mostly run into the bounds: what was measured and wanted, and the inputs
 * that Python computed from it in double precision. */
#ifndef VECTORS_H
#define VECTORS_H

#include "{{ name }}.h"

#define VECTORS_EPISODE {{ episode }} /* samples of the episode */
#define VECTORS_SAMPLES {{ output | length }} /* in all */
#define VECTORS_STARTS {{ held | length }}
#define VECTORS_TOLERANCE {{ replay_tolerance | number }} /* largest difference allowed, as a share of the input bound */

static const real vectors_scale[{{ NAME }}_INPUTS] = {{ scale | c }}; /* the larger bound of each input */

/* Samples before which the controller starts anew, and the inputs under which the robot rests then. */
static const int vectors_start[VECTORS_STARTS] = { {{- start | join(", ") -}} };

static const real vectors_held[VECTORS_STARTS][{{ NAME }}_INPUTS] = {{ held | c }};

static const real vectors_output[VECTORS_SAMPLES][{{ NAME }}_OUTPUTS] = {{ output | c }};

static const real vectors_reference[VECTORS_SAMPLES][{{ NAME }}_PREVIEW * {{ NAME }}_OUTPUTS] = {{ reference | c }};
{% if disturbances %}
static const real vectors_disturbance[VECTORS_SAMPLES][{{ NAME }}_DISTURBANCES] = {{ disturbance | c }};
{% endif %}
static const real vectors_input[VECTORS_SAMPLES][{{ NAME }}_INPUTS] = {{ input | c }};

#endif
