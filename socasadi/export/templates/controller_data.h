{# Data of one controller: everything that changes with theta, beside law.c. #}
/* {{ title }}
 *
{% for line in provenance %} * {{ line }}
{% endfor %} */
#ifndef CONTROLLER_DATA_H
#define CONTROLLER_DATA_H

#define CONTROLLER_SAMPLE_TIME {{ sample_time }} /* s */
#define CONTROLLER_OUTPUTS {{ outputs }}
#define CONTROLLER_INPUTS {{ inputs }}
#define CONTROLLER_HORIZON {{ horizon }}
#define CONTROLLER_MODEL_ORDER {{ order }}
#define CONTROLLER_STATES {{ order + outputs + inputs }}

/* u_max, N: inside the controller inputs are shares of it */
static const double controller_input_scale[CONTROLLER_INPUTS] = {{ scale | c }};

/* model state at rest under each input */
static const double controller_rest[CONTROLLER_MODEL_ORDER][CONTROLLER_INPUTS] = {{ rest | c }};

#endif
