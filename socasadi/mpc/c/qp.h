/* A strictly convex quadratic program in its dual, for a dual active-set method.
 *
 * Primal, in z:   min  z'Hz/2 + f'z + sum over soft rows of (price s + s^2 / (2 softness))
 *                 with  lower_i <= a_i'z <= upper_i,  soft rows exceeding a bound by s >= 0.
 *
 * Only the rows' values matter to the method: where the bounds do not bind they are centre_i = a_i' z_0, z_0 = -H^-1 f,
 * and multipliers move them to centre - gram * multiplier, with gram_ij = a_i' H^-1 a_j. So the problem is given by gram
 * and the bounds, which do not change from sample to sample, and by centre, which does. Rows are scaled such that
 * gram_ii + softness_i = 1.
 */
#ifndef QP_H
#define QP_H

#include "real.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    int rows;
    int iterations;       /* cap: changes of the working set in one solution */
    const real *gram;     /* lower triangle, row after row: rows (rows + 1) / 2 */
    const real *lower;    /* rows */
    const real *upper;    /* rows */
    const real *softness; /* rows; 0: the row is hard */
    const real *price;    /* rows; of soft rows: multiplier up to which a soft row is kept like a hard one */
    const real *unit;     /* rows; what 1 in the scaled row is in the row's own unit */
} qp_problem;

enum qp_status {
    QP_OPTIMAL = 0,
    QP_INFEASIBLE = 1,
    QP_CAPPED = 2 /* the cap of iterations was met first */
};

/* Memory that one solver needs. */
#define QP_REALS(rows) ((rows) * ((rows) - 1) / 2 + 4 * (rows))
#define QP_INTS(rows) (2 * (rows))

/* One solver. Between calls it remembers the working set, from which the next solution starts. */
typedef struct {
    const qp_problem *problem;
    real *value;      /* rows: centre - gram multiplier, after a solution */
    real *multiplier; /* rows: positive where an upper bound is active, negative where a lower one is */
    int iterations;   /* of the last solution */
    /* Private: */
    int active;       /* size of the working set */
    int *row;         /* active: its rows */
    int *state;       /* rows: which bound is active and how, see qp.c */
    real *factor;     /* L without its unit diagonal, row after row: L D L' = gram (working set) + softness (slack ones) */
    real *diagonal;   /* active: D */
    real *direction;  /* active: change of the working set's multipliers */
} qp;

/* Lays the solver out in reals[QP_REALS(rows)] and ints[QP_INTS(rows)], with an empty working set. */
void qp_init(qp *self, const qp_problem *problem, real *reals, int *ints);

/* Forgets the working set. */
void qp_reset(qp *self);

/* Solves for these centres (rows); self->value and self->multiplier are the answer. Returns an enum qp_status. */
int qp_solve(qp *self, const real *centre);

/* Largest violation of the optimality conditions by self->multiplier, each in its row's own unit, computed anew from
 * problem, centre and multiplier alone; self->value is computed anew with it. REAL_MAX when anything is not finite. */
real qp_residual(qp *self, const real *centre);

#ifdef __cplusplus
}
#endif

#endif
