/* A tuned model predictive controller: one call a sample.
 *
 *   controller c;
 *   controller_init(&c);                      once
 *   controller_reset(&c, u_before);           whenever the robot rests under known tensions
 *   status = controller_step(&c, y, r, u);    every CONTROLLER_SAMPLE_TIME seconds
 *
 * y is measured now, after the last u has been held for one sample; u is to be held until the next call. Row k of r
 * (row after row, CONTROLLER_OUTPUTS numbers each) is wanted k + 1 samples from now. Metres and newtons.
 * Whatever comes in, u is finite and inside its bounds. A y that is not finite, or 1e3 and more, corrects nothing: the
 * observer then only predicts.
 */
#ifndef CONTROLLER_H
#define CONTROLLER_H

#include "controller_data.h"

#ifdef __cplusplus
extern "C" {
#endif

enum controller_status {
    CONTROLLER_OPTIMAL = 0, /* u is the QP's answer, checked against its optimality conditions */
    CONTROLLER_CLIPPED = 1, /* the QP gave no answer that passed: the unconstrained law, clipped to the bounds */
    CONTROLLER_HELD = 2     /* that was not finite either, or r was not: the tensions before are held */
};

typedef struct {
    double state[CONTROLLER_STATES];
    unsigned long steps;
    unsigned long clipped; /* how often the clipped law was applied */
    unsigned long held;    /* how often the tensions before were held */
    double residual;       /* KKT residual of the last answer */
    int solver;            /* the QP solver's memory */
} controller;

/* 0, or 1 when the solver found no memory. The robot is taken to rest without tensions. */
int controller_init(controller *self);

/* The robot rests under the tensions u_before. */
void controller_reset(controller *self, const double u_before[CONTROLLER_INPUTS]);

/* One sample; returns an enum controller_status. */
int controller_step(controller *self, const double y[CONTROLLER_OUTPUTS],
                    const double r[CONTROLLER_HORIZON * CONTROLLER_OUTPUTS], double u[CONTROLLER_INPUTS]);

/* Gives the solver's memory back. */
void controller_free(controller *self);

#ifdef __cplusplus
}
#endif

#endif
