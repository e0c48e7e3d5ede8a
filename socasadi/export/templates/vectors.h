/* A recorded episode: what was measured and wanted, and the inputs that Python computed from it in double precision. */
#ifndef VECTORS_H
#define VECTORS_H

#include "{{ name }}.h"

#define VECTORS_SAMPLES {{ samples }}
#define VECTORS_TOLERANCE {{ replay_tolerance | number }} /* largest difference allowed, as a share of the input bound */

static const real vectors_scale[{{ NAME }}_INPUTS] = {{ scale | c }}; /* the larger bound of each input */

static const real vectors_held[{{ NAME }}_INPUTS] = {{ held | c }};

static const real vectors_output[VECTORS_SAMPLES][{{ NAME }}_OUTPUTS] = {{ output | c }};

static const real vectors_reference[VECTORS_SAMPLES][{{ NAME }}_PREVIEW * {{ NAME }}_OUTPUTS] = {{ reference | c }};
{% if disturbances %}
static const real vectors_disturbance[VECTORS_SAMPLES][{{ NAME }}_DISTURBANCES] = {{ disturbance | c }};
{% endif %}
static const real vectors_input[VECTORS_SAMPLES][{{ NAME }}_INPUTS] = {{ input | c }};

#endif
