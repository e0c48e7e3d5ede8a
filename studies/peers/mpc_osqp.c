/* OSQP's generated C (parameters = "vectors"): per problem a gradient and bounds, then osqp_solve. */
#include "mpc_time.h"
#include "osqp.h"
#include "problem.h"
#include "workspace.h"

void solver_setup(void) {}

void solver_forget(void) { osqp_cold_start(&solver); }

int solver_solve(const double *p) {
    static double q[INPUTS + OUTPUT_ROWS], l[ROWS], u[ROWS];
    for (int i = 0; i < INPUTS; ++i) q[i] = 0;
    for (int k = 0; k < PARAMETERS; ++k)
        for (int i = 0; i < INPUTS; ++i) q[i] += p[k] * COST * gradient[k][i];
    for (int i = 0; i < INPUTS; ++i) {
        l[i] = -1;
        u[i] = 1;
    }
    for (int i = INPUTS; i < ROWS; ++i) {
        double free = 0;
        for (int k = 0; k < PARAMETERS; ++k) free += row_free[k][i] * p[k];
        l[i] = -1 - free;
        u[i] = 1 - free;
    }
    if (osqp_update_data_vec(&solver, q, l, u) || osqp_solve(&solver)) return -1;
    return solver.info->status_val == OSQP_SOLVED ? (int)solver.info->iter : -1;
}

void solver_answer(double *z) {
    for (int i = 0; i < INPUTS; ++i) z[i] = solver.solution->x[i];
}
