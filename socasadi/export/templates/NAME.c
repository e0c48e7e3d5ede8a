#include "{{ name }}.h"

#include "{{ name }}_data.h"

/* Data of other sizes do not compile. */
typedef char map_has_its_size[sizeof {{ name }}_map == sizeof(real) * {{ NAME }}_ROWS * MPC_PARAMETERS({{ NAME }}_ORDER, {{ NAME }}_INPUTS, {{ NAME }}_OUTPUTS, {{ NAME }}_DISTURBANCES, {{ NAME }}_PREVIEW) ? 1 : -1];
typedef char gram_has_its_size[2 * sizeof {{ name }}_qp_gram == sizeof(real) * {{ NAME }}_ROWS * ({{ NAME }}_ROWS + 1) ? 1 : -1];

static const mpc_data data = {
    .order = {{ NAME }}_ORDER,
    .inputs = {{ NAME }}_INPUTS,
    .outputs = {{ NAME }}_OUTPUTS,
    .disturbances = {{ NAME }}_DISTURBANCES,
    .preview = {{ NAME }}_PREVIEW,
    .tolerance = {{ NAME }}_TOLERANCE,
    .plausible = {{ NAME }}_PLAUSIBLE,
{% for array in arrays %}    .{{ array }} = {{ name }}_{{ array }},
{% endfor %}    .qp = {
        .rows = {{ NAME }}_ROWS,
        .iterations = {{ iterations }},
{% for array in program %}        .{{ array }} = {{ name }}_qp_{{ array }},
{% endfor %}    },
};

void {{ name }}_init({{ name }} *self) { mpc_init(&self->controller, &data, self->reals, self->ints); }

void {{ name }}_reset({{ name }} *self, const real u_before[{{ NAME }}_INPUTS]) { mpc_reset(&self->controller, u_before); }

int {{ name }}_step({{ name }} *self, const real y[{{ NAME }}_OUTPUTS],
    const real r[{{ NAME }}_PREVIEW * {{ NAME }}_OUTPUTS],{% if disturbances %} const real w[{{ NAME }}_DISTURBANCES],{% endif %} real u[{{ NAME }}_INPUTS]) {
    return mpc_step(&self->controller, y, r, {{ "w" if disturbances else "0" }}, u);
}

mpc_info {{ name }}_info(const {{ name }} *self) { return self->controller.info; }
