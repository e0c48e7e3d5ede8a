#include "tracking.h"

#include "tables.h"

static const qp_problem problem = {ROWS, 50 + 2 * ROWS, gram, lower, upper, softness, price, unit};

void tracking_init(tracking *self) { qp_init(&self->solver, &problem, self->reals, self->ints); }

void tracking_reset(tracking *self, const real *ignored) {
    (void)ignored;
    qp_reset(&self->solver);
}

int tracking_step(tracking *self, const real *p, const real *ignored, real *u) {
    int i, k;
    (void)ignored;
    for (i = 0; i < ROWS; ++i) self->centre[i] = p[0] * map[0][i];
    for (k = 1; k < PARAMETERS; ++k)
        for (i = 0; i < ROWS; ++i) self->centre[i] += p[k] * map[k][i];
    self->info.status = qp_solve(&self->solver, self->centre);
    self->info.iterations = self->solver.iterations;
#ifdef CHECKED
    self->info.residual = qp_residual(&self->solver, self->centre);
#endif
    for (i = 0; i < TRACKING_INPUTS; ++i) u[i] = self->solver.value[i] * unit[i];
    return self->info.status;
}

mpc_info tracking_info(const tracking *self) { return self->info; }
