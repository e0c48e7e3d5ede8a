/* The tracking QP with the face of an exported controller, for the emulated microcontroller: y is the parameters. */
#ifndef TRACKING_H
#define TRACKING_H

#include "qp.h"
#include "sizes.h"

#define TRACKING_OUTPUTS PARAMETERS
#define TRACKING_INPUTS FIRST_INPUTS
#define TRACKING_PREVIEW 1
#define TRACKING_DISTURBANCES 0

typedef struct {
    int status, iterations;
    real residual;
    unsigned long steps, clipped, held, refused;
    int worst_iterations;
    real worst_residual;
} mpc_info;

typedef struct {
    qp solver;
    mpc_info info;
    real reals[QP_REALS(ROWS)], centre[ROWS];
    int ints[QP_INTS(ROWS)];
} tracking;

void tracking_init(tracking *self);
void tracking_reset(tracking *self, const real *ignored);
int tracking_step(tracking *self, const real *p, const real *ignored, real *u);
mpc_info tracking_info(const tracking *self);

#endif
