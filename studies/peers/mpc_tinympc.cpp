/* TinyMPC's generated C++: a start and a reference for its states, which are turned such that their weight is diagonal. */
#include <iostream>

#include "mpc_time.h"
#include "problem.h"
#include "tinympc/admm.hpp"
#include "tinympc/tiny_data.hpp"

constexpr int STATES = PARAMETERS - OUTPUTS, STAGES = INPUTS / FIRST_INPUTS;

void solver_setup() { std::cout.setstate(std::ios::failbit); } /* it prints in every solution */

void solver_forget() {
    TinyWorkspace &work = *tiny_solver.work;
    for (tinyMatrix *matrix : {&work.x, &work.u, &work.q, &work.r, &work.p, &work.d}) matrix->setZero();
    for (tinyMatrix *matrix : {&work.v, &work.vnew, &work.z, &work.znew, &work.g, &work.y}) matrix->setZero();
}

int solver_solve(const double *p) {
    for (int i = 0; i < STATES; ++i) {
        double start = 0, wanted = 0;
        for (int k = 0; k < STATES; ++k) start += turn[i][k] * p[k];
        for (int k = 0; k < OUTPUTS; ++k) wanted += reference[i][k] * p[STATES + k];
        tiny_solver.work->x(i, 0) = start;
        tiny_solver.work->Xref.row(i).setConstant(wanted);
    }
    return solve(&tiny_solver) ? -1 : tiny_solver.solution->iter;
}

void solver_answer(double *z) {
    for (int k = 0; k < STAGES; ++k)
        for (int i = 0; i < FIRST_INPUTS; ++i) z[k * FIRST_INPUTS + i] = tiny_solver.solution->u(i, k) / UMAX;
}
