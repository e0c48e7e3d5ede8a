/* socasadi's whole controller: mpc_step for a measurement and a reference.
 *
 * With -DPLACED the parameters begin with a state, to which the observer comes in this step, so that the controller
 * meets problems that are not those of a closed loop.
 */
#include "mpc.h"
#include "mpc_time.h"
#include "problem.h"

static const mpc_data data = {
    .order = data_order, .inputs = data_inputs, .outputs = data_outputs, .disturbances = data_disturbances,
    .preview = data_preview, .tolerance = data_tolerance, .plausible = data_plausible,
    .A = data_A, .B = data_B, .E = data_E, .C = data_C, .D = data_D, .F = data_F, .gain = data_gain, .rest = data_rest,
    .map = data_map, .scale = data_scale, .lower = data_lower, .upper = data_upper,
    .qp = {ROWS, qp_iterations, qp_gram, qp_lower, qp_upper, qp_softness, qp_price, qp_unit},
};
static mpc controller;
static real reals[MPC_REALS(data_order, data_inputs, data_outputs, data_disturbances, data_preview, ROWS)];
static int ints[MPC_INTS(ROWS)];

void solver_setup(void) { mpc_init(&controller, &data, reals, ints); }

void solver_forget(void) {
    static const real rest_input[FIRST_INPUTS];
    mpc_reset(&controller, rest_input);
}

#ifdef PLACED
void solver_prepare(const double *p) {
    for (int i = 0; i < data_order; ++i) {
        controller.x[i] = 0;
        for (int j = 0; j < data_order; ++j) {
            double before = p[j];
            for (int k = 0; k < data_inputs; ++k) before -= data_B[j * data_inputs + k] * controller.v[k];
            controller.x[i] += data_back[i][j] * before;
        }
    }
}
#endif

int solver_solve(const double *p) {
#ifdef PLACED
    p += data_order;
#endif
    static real u[FIRST_INPUTS];
    const int status = mpc_step(&controller, p, p + data_outputs, 0, u);
    return status == MPC_OPTIMAL ? controller.info.iterations : -1;
}

void solver_answer(double *z) {
    for (int i = 0; i < INPUTS; ++i) z[i] = controller.solver.value[i] * qp_unit[i];
}
