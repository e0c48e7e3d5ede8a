/* A linear model predictive controller: observer, quadratic program, checks, fallbacks. One call a sample.
 *
 * Inside, inputs are v = u / scale. The observer's state x holds the model's states, inputs on their way (delay) and
 * disturbances:
 *     x+ = A x + B v + E w,     y = C x + D v + F w,     x <- x + gain (y - C x - D v - F w),
 * where v and w were held while y came about. The rows of the quadratic program at the unconstrained optimum are
 *     centre = map (x, v before, reference, w, 1),
 * and its first rows are the first input itself. All matrices are row after row, map is column after column.
 */
#ifndef MPC_H
#define MPC_H

#include "qp.h"
#include "real.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    int order;        /* of the observer */
    int inputs;
    int outputs;
    int disturbances; /* measured ones */
    int preview;      /* rows of the reference */
    real tolerance;   /* KKT residual up to which an answer is believed */
    real plausible;   /* a measurement of this magnitude or more is refused */
    const real *A, *B, *E, *C, *D, *F, *gain;
    const real *rest; /* order x inputs: x at rest under a constant v */
    const real *map;  /* (order + inputs + preview outputs + disturbances + 1) columns of qp.rows */
    const real *scale, *lower, *upper; /* inputs: of u, in its own unit */
    const real *slowest, *fastest;     /* inputs: bounds of the change of v in a sample; null: none */
    qp_problem qp;
} mpc_data;

enum mpc_status {
    MPC_OPTIMAL = 0, /* u is the QP's answer, checked against its optimality conditions. (Even if y was refused: then it
                      * is the answer for the predicted state, and info.refused has counted one more. With a sensor
                      * dead for longer than the model can be trusted, stop.) */
    MPC_CLIPPED = 1, /* the QP gave no answer that passed: the unconstrained law, clipped to the bounds */
    MPC_HELD = 2     /* that was not finite, or the reference was not: the input before is held */
};

typedef struct {
    int status;              /* of the last step */
    int iterations;          /* of the QP in the last step */
    real residual;           /* KKT residual of the QP's last answer; REAL_MAX: it was no number */
    unsigned long steps;     /* since the reset, as all that follow */
    unsigned long clipped;   /* steps that ended MPC_CLIPPED */
    unsigned long held;      /* steps that ended MPC_HELD */
    unsigned long refused;   /* measurements that corrected nothing */
    int worst_iterations;
    real worst_residual;     /* of the answers that were applied */
} mpc_info;

/* Memory that one controller needs. */
#define MPC_PARAMETERS(order, inputs, outputs, disturbances, preview) \
    ((order) + (inputs) + (preview) * (outputs) + (disturbances) + 1)
#define MPC_REALS(order, inputs, outputs, disturbances, preview, rows)                                       \
    (2 * (order) + (inputs) + (outputs) + (disturbances) + (rows) + QP_REALS(rows) + \
     MPC_PARAMETERS(order, inputs, outputs, disturbances, preview))
#define MPC_INTS(rows) QP_INTS(rows)

typedef struct {
    const mpc_data *data;
    mpc_info info;
    /* Private: */
    real *x, *v, *w;                              /* after the last sample */
    real *predicted, *innovation, *parameters, *centre;
    qp solver;
} mpc;

/* Lays the controller out in reals[MPC_REALS(...)] and ints[MPC_INTS(...)]; the robot is taken to rest without input.
 * It comes before anything else, and again for a copy: self points into that memory. */
void mpc_init(mpc *self, const mpc_data *data, real *reals, int *ints);

/* The robot rests under the inputs u_before (inputs), undisturbed as far as is known. What is not finite counts as 0;
 * what is out of the bounds is believed, and the first u is inside all the same. */
void mpc_reset(mpc *self, const real *u_before);

/* One sample; returns an enum mpc_status.
 *
 * y (outputs) was measured just now, after the last u was held for one sample. Row k of reference (preview rows of
 * outputs) is wanted k + 1 samples from now, the last row from then on. w (disturbances) is measured now and taken to
 * stay; null when there are none. u (inputs) is to be held until the next call.
 *
 * Whatever comes in, u is finite, inside its bounds, and no further from the u before than its rate bounds allow. A y
 * that is not finite or not plausible corrects nothing: the observer then only predicts. A w that is not finite is
 * taken to be the one before.
 */
int mpc_step(mpc *self, const real *y, const real *reference, const real *w, real *u);

#ifdef __cplusplus
}
#endif

#endif
