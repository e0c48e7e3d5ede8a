/* CasADi's generated C: solution.c is the function p -> z with the quadratic program inside. */
#include "mpc_time.h"
#include "problem.h"
#include "solution.h"

static const double *arguments[solution_SZ_ARG];
static double *results[solution_SZ_RES], w[solution_SZ_W + 1], z_now[INPUTS];
static casadi_int iw[solution_SZ_IW + 1];
static int memory;

void solver_setup(void) { memory = solution_checkout(); }

void solver_forget(void) {}

int solver_solve(const double *p) {
    arguments[0] = p;
    results[0] = z_now;
    return solution(arguments, results, iw, w, memory) ? -1 : 0;
}

void solver_answer(double *z) {
    for (int i = 0; i < INPUTS; ++i) z[i] = z_now[i];
}
