{# The only file of an export that depends on theta. -#}
/* {{ title }}: its numbers. A new theta changes this file alone{{ ", and osqp/osqp_workspace.c" if osqp else "" }}.
 *
{% for line in provenance %} * {{ line }}
{% endfor %} */
#ifndef {{ NAME }}_DATA_H
#define {{ NAME }}_DATA_H

#include "real.h"

{% for array, values in tables %}static const real {{ name }}_{{ array }}[] = {{ values | c }};

{% endfor %}#define {{ NAME }}_TOLERANCE {{ tolerance | number }} /* KKT residual, in shares of the bounds, up to which an answer is believed */
#define {{ NAME }}_PLAUSIBLE {{ plausible | number }} /* a measurement of this magnitude or more is refused */

#endif
