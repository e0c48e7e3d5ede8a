/* socasadi's own active-set method: centres are affine in the parameters, then qp_solve, and with -DCHECKED qp_residual.
 *
 * The first rows are the inputs, so that a solution's values are its answer.
 */
#include "mpc_time.h"
#include "problem.h"
#include "qp.h"

static const qp_problem problem = {ROWS, 100 + 10 * ROWS, gram, lower, upper, softness, price, unit};
static qp solver;
static real reals[QP_REALS(ROWS)], centre[ROWS];
static int ints[QP_INTS(ROWS)];

void solver_setup(void) { qp_init(&solver, &problem, reals, ints); }

void solver_forget(void) { qp_reset(&solver); }

int solver_solve(const double *p) {
    static real first[FIRST_INPUTS];
    for (int i = 0; i < ROWS; ++i) centre[i] = p[0] * map[0][i];
    for (int k = 1; k < PARAMETERS; ++k)
        for (int i = 0; i < ROWS; ++i) centre[i] += p[k] * map[k][i];
    int status = qp_solve(&solver, centre);
#ifdef CHECKED
    if (!(qp_residual(&solver, centre) <= 1e-6)) status = QP_INFEASIBLE;
#endif
    for (int i = 0; i < FIRST_INPUTS; ++i) first[i] = solver.value[i] * unit[i];
    return status == QP_OPTIMAL ? solver.iterations : -1;
}

void solver_answer(double *z) {
    for (int i = 0; i < INPUTS; ++i) z[i] = solver.value[i] * unit[i];
}
