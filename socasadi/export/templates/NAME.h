/* {{ title }}: one call a sample.
 *
 *   static {{ name }} c;
 *   {{ name }}_init(&c);                        once, before anything else; a copy of c needs its own
 *   {{ name }}_reset(&c, u_before);             whenever the robot rests under known inputs
 *   status = {{ name }}_step(&c, y, r{{ ", w" if disturbances else "" }}, u);   every {{ NAME }}_SAMPLE_TIME seconds
 *
 * Units are those of the campaign: y and r in metres and u in newtons, unless the study says otherwise. What is done
 * with each argument, and what is promised of u, is said in mpc.h.
{% if osqp %} * OSQP keeps its workspace in static memory: one controller, one instance, never two steps at a time. None allocates.
{% else %} * Everything is in the struct: several controllers may run side by side, and none allocates. One struct belongs to one
 * caller: never step it from a thread and an interrupt at once.
{% endif %} */
#ifndef {{ NAME }}_H
#define {{ NAME }}_H

#include "mpc.h"

{% if real == "float" %}#ifndef REAL_FLOAT
#error "include {{ name }}.h, which is in float, in another file than a controller in double"
#endif
{% else %}#ifdef REAL_FLOAT
#error "include {{ name }}.h, which is in double, in another file than a controller in float"
#endif
{% endif %}
#ifdef __cplusplus
extern "C" {
#endif

#define {{ NAME }}_SAMPLE_TIME {{ sample_time | number }} /* s */
#define {{ NAME }}_OUTPUTS {{ outputs }}
#define {{ NAME }}_INPUTS {{ inputs }}
#define {{ NAME }}_PREVIEW {{ preview }} /* rows of the reference */
#define {{ NAME }}_DISTURBANCES {{ disturbances }} /* measured ones */
#define {{ NAME }}_ORDER {{ order }} /* of the observer */
#define {{ NAME }}_ROWS {{ rows }} /* constraints of the quadratic program */

typedef struct {
    mpc controller;
    real reals[MPC_REALS({{ NAME }}_ORDER, {{ NAME }}_INPUTS, {{ NAME }}_OUTPUTS, {{ NAME }}_DISTURBANCES, {{ NAME }}_PREVIEW, {{ NAME }}_ROWS)];
    int ints[MPC_INTS({{ NAME }}_ROWS)];
} {{ name }};

/* The robot is taken to rest without input. */
void {{ name }}_init({{ name }} *self);

/* The robot rests under the inputs u_before. */
void {{ name }}_reset({{ name }} *self, const real u_before[{{ NAME }}_INPUTS]);

/* One sample; returns an enum mpc_status. Row k of r is wanted k + 1 samples from now. */
int {{ name }}_step({{ name }} *self, const real y[{{ NAME }}_OUTPUTS],
    const real r[{{ NAME }}_PREVIEW * {{ NAME }}_OUTPUTS],{% if disturbances %} const real w[{{ NAME }}_DISTURBANCES],{% endif %} real u[{{ NAME }}_INPUTS]);

/* Status, iterations and KKT residual of the last step; counts of steps and fallbacks since the reset. */
mpc_info {{ name }}_info(const {{ name }} *self);

#ifdef __cplusplus
}
#endif

#endif
