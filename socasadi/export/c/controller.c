#include "controller.h"

#include <math.h>
#include <string.h>

#include "law.h"

#define LARGER(a, b) ((a) > (b) ? (a) : (b))

enum { LAST_INPUT = CONTROLLER_STATES - CONTROLLER_INPUTS };

static int all_finite(const double *values, int count) {
    int i;
    for (i = 0; i < count; ++i)
        if (!isfinite(values[i])) return 0;
    return 1;
}

int controller_init(controller *self) {
    static const double none[CONTROLLER_INPUTS] = {0};
    law_incref();
    self->solver = law_checkout();
    controller_reset(self, none);
    return self->solver < 0;
}

void controller_free(controller *self) {
    law_release(self->solver);
    law_decref();
}

void controller_reset(controller *self, const double u_before[CONTROLLER_INPUTS]) {
    int i, j;
    memset(self->state, 0, sizeof self->state);
    for (j = 0; j < CONTROLLER_INPUTS; ++j) {
        const double v = u_before[j] / controller_input_scale[j];
        for (i = 0; i < CONTROLLER_MODEL_ORDER; ++i) self->state[i] += controller_rest[i][j] * v;
        self->state[LAST_INPUT + j] = v;
    }
    self->steps = self->clipped = self->held = 0;
    self->residual = 0.0;
}

int controller_step(controller *self, const double y[CONTROLLER_OUTPUTS],
                    const double r[CONTROLLER_HORIZON * CONTROLLER_OUTPUTS], double u[CONTROLLER_INPUTS]) {
    double work[LARGER(law_SZ_W, law_without_qp_SZ_W)];
    const double *arguments[LARGER(law_SZ_ARG, law_without_qp_SZ_ARG)];
    double *results[LARGER(law_SZ_RES, law_without_qp_SZ_RES)];
    double next[CONTROLLER_STATES], status = CONTROLLER_HELD, residual = INFINITY;

    arguments[0] = y;
    arguments[1] = r;
    arguments[2] = self->state;
    results[0] = u;
    results[1] = next;
    results[2] = &status;
    results[3] = &residual;
    /* A solver that gives up writes nothing and returns 1; the law without it then takes over. */
    if (!all_finite(r, CONTROLLER_HORIZON * CONTROLLER_OUTPUTS) || law(arguments, results, 0, work, self->solver))
        law_without_qp(arguments, results, 0, work, 0);
    self->steps += 1;
    self->clipped += status == CONTROLLER_CLIPPED;
    self->held += status == CONTROLLER_HELD;
    self->residual = residual;
    if (all_finite(next, CONTROLLER_STATES)) memcpy(self->state, next, sizeof next);
    return (int)status;
}
