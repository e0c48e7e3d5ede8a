/* CVXPYgen's C: the parameters are set, cpg_solve forms the program and solves it. */
#include "mpc_time.h"
#include "cpg_solve.h"
#include "problem.h"

void solver_setup(void) {}

void solver_forget(void) {}

int solver_solve(const double *p) {
    for (int k = 0; k < PARAMETERS; ++k) cpg_update_p(k, p[k]);
    cpg_solve();
    return CPG_Info.status[0] == 's' ? (int)CPG_Info.iter : -1; /* "solved", but not "solved inaccurate" */
}

void solver_answer(double *z) {
    for (int i = 0; i < INPUTS; ++i) z[i] = CPG_Result.prim->z[i];
}
