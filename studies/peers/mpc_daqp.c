/* DAQP's method with everything set up beforehand: per problem only the bounds of its minimum-distance form change.
 *
 * setup_daqp factorises H and scales the rows. Shifted by the unconstrained optimum, the bounds are affine in the
 * parameters, so that neither a gradient nor a factorisation is left: daqp_ldp, and the first inputs.
 */
#include <daqp/api.h>
#include <daqp/utils.h>

#include "mpc_time.h"
#include "problem.h"

static DAQPWorkspace work;
static DAQPProblem problem;
static double upper[ROWS], lower[ROWS], map[PARAMETERS][ROWS], centre[ROWS];
static int sense[ROWS];

void solver_setup(void) {
    static double zero[INPUTS];
    for (int i = 0; i < ROWS; ++i) {
        sense[i] = i < INPUTS ? 0 : SOFT;
        upper[i] = 1;
        lower[i] = -1;
    }
    problem = (DAQPProblem){INPUTS, ROWS, INPUTS, (double *)hessian, zero, (double *)response, upper, lower, sense};
    allocate_daqp_settings(&work);
    if (SOFTENING > 0) work.settings->rho_soft = 1 / SOFTENING;
    work.settings->primal_tol = 1e-9;
    setup_daqp(&problem, &work, 0);
    for (int i = 0; i < ROWS; ++i) {
        upper[i] = work.scaling[i];
        lower[i] = -work.scaling[i];
        for (int k = 0; k < PARAMETERS; ++k) map[k][i] = work.scaling[i] * row_map[k][i];
    }
}

void solver_forget(void) {
    deactivate_constraints(&work);
    reset_daqp_workspace(&work);
}

/* Rows of the inverse of H's factor are scaled like the bounds. */
static double input(int i, const double *row) {
    double sum = centre[i];
    for (int j = i; j < INPUTS; ++j) sum += row[j - i] * work.u[j];
    return sum / work.scaling[i];
}

int solver_solve(const double *p) {
    static double first[FIRST_INPUTS];
    for (int i = 0; i < ROWS; ++i) centre[i] = p[0] * map[0][i];
    for (int k = 1; k < PARAMETERS; ++k)
        for (int i = 0; i < ROWS; ++i) centre[i] += p[k] * map[k][i];
    for (int i = 0; i < ROWS; ++i) {
        work.dupper[i] = upper[i] - centre[i];
        work.dlower[i] = lower[i] - centre[i];
    }
    work.reuse_ind = 0; /* the factorisation stays, the right-hand side is new */
    const int flag = daqp_ldp(&work);
    for (int i = 0, at = 0; i < FIRST_INPUTS; at += INPUTS - i++) first[i] = input(i, work.Rinv + at);
    return flag > 0 ? work.iterations : -1;
}

void solver_answer(double *z) {
    for (int i = 0, at = 0; i < INPUTS; at += INPUTS - i++) z[i] = input(i, work.Rinv + at);
}
