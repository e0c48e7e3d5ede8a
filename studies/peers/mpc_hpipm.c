/* HPIPM's dense interior point method, with its own soft rows; per problem a gradient and bounds are new. */
#include <hpipm_d_dense_qp.h>
#include <hpipm_d_dense_qp_dim.h>
#include <hpipm_d_dense_qp_ipm.h>
#include <hpipm_d_dense_qp_sol.h>
#include <stdlib.h>

#include "mpc_time.h"
#include "problem.h"

static struct d_dense_qp_dim dim;
static struct d_dense_qp qp;
static struct d_dense_qp_sol solution;
static struct d_dense_qp_ipm_arg arg;
static struct d_dense_qp_ipm_ws work;
static double z_now[INPUTS];

void solver_setup(void) {
    static double H[INPUTS * INPUTS], C[INPUTS * (OUTPUT_ROWS + 1)], ones[ROWS], minus[ROWS];
    static double Z[OUTPUT_ROWS + 1], nothing[OUTPUT_ROWS + 1];
    static int rows[ROWS], soft[OUTPUT_ROWS + 1];
    double tolerance = 1e-9, mu0 = 1;
    int limit = 60, no = 0;
    for (int i = 0; i < INPUTS; ++i)
        for (int j = 0; j < INPUTS; ++j) H[i * INPUTS + j] = COST * hessian[i][j];
    for (int i = 0; i < OUTPUT_ROWS; ++i)
        for (int j = 0; j < INPUTS; ++j) C[j * OUTPUT_ROWS + i] = ((const double *)response)[i * INPUTS + j];
    for (int i = 0; i < ROWS; ++i) {
        ones[i] = 1;
        minus[i] = -1;
        rows[i] = i;
    }
    for (int i = 0; i < OUTPUT_ROWS; ++i) {
        Z[i] = COST * SOFTENING;
        soft[i] = INPUTS + i;
    }
    d_dense_qp_dim_create(&dim, malloc(d_dense_qp_dim_memsize()));
    d_dense_qp_dim_set_all(INPUTS, 0, INPUTS, OUTPUT_ROWS, OUTPUT_ROWS, &dim);
    d_dense_qp_create(&dim, &qp, malloc(d_dense_qp_memsize(&dim)));
    d_dense_qp_set_H(H, &qp);
    d_dense_qp_set_idxb(rows, &qp);
    d_dense_qp_set_lb(minus, &qp);
    d_dense_qp_set_ub(ones, &qp);
    if (OUTPUT_ROWS) {
        d_dense_qp_set_C(C, &qp);
        d_dense_qp_set_idxs(soft, &qp);
        d_dense_qp_set_Zl(Z, &qp);
        d_dense_qp_set_Zu(Z, &qp);
        d_dense_qp_set_zl(nothing, &qp);
        d_dense_qp_set_zu(nothing, &qp);
        d_dense_qp_set_lls(nothing, &qp);
        d_dense_qp_set_lus(nothing, &qp);
    }
    d_dense_qp_sol_create(&dim, &solution, malloc(d_dense_qp_sol_memsize(&dim)));
    d_dense_qp_ipm_arg_create(&dim, &arg, malloc(d_dense_qp_ipm_arg_memsize(&dim)));
    d_dense_qp_ipm_arg_set_default(SPEED, &arg);
    d_dense_qp_ipm_arg_set_mu0(&mu0, &arg);
    d_dense_qp_ipm_arg_set_iter_max(&limit, &arg);
    d_dense_qp_ipm_arg_set_tol_stat(&tolerance, &arg);
    d_dense_qp_ipm_arg_set_tol_ineq(&tolerance, &arg);
    d_dense_qp_ipm_arg_set_tol_comp(&tolerance, &arg);
    d_dense_qp_ipm_arg_set_compute_obj(&no, &arg);
    d_dense_qp_ipm_ws_create(&dim, &arg, &work, malloc(d_dense_qp_ipm_ws_memsize(&dim, &arg)));
}

void solver_forget(void) {}

int solver_solve(const double *p) {
    static double g[INPUTS], lower[OUTPUT_ROWS + 1], upper[OUTPUT_ROWS + 1];
    for (int i = 0; i < INPUTS; ++i) g[i] = 0;
    for (int k = 0; k < PARAMETERS; ++k)
        for (int i = 0; i < INPUTS; ++i) g[i] += p[k] * COST * gradient[k][i];
    for (int i = 0; i < OUTPUT_ROWS; ++i) {
        double free = 0;
        for (int k = 0; k < PARAMETERS; ++k) free += row_free[k][INPUTS + i] * p[k];
        lower[i] = -1 - free;
        upper[i] = 1 - free;
    }
    d_dense_qp_set_g(g, &qp);
    if (OUTPUT_ROWS) {
        d_dense_qp_set_lg(lower, &qp);
        d_dense_qp_set_ug(upper, &qp);
    }
    d_dense_qp_ipm_solve(&qp, &solution, &arg, &work);
    d_dense_qp_sol_get_v(&solution, z_now);
    int status, iterations;
    d_dense_qp_ipm_get_status(&work, &status);
    d_dense_qp_ipm_get_iter(&work, &iterations);
    return status ? -1 : iterations;
}

void solver_answer(double *z) {
    for (int i = 0; i < INPUTS; ++i) z[i] = z_now[i];
}
