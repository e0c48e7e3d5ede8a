/* The check of every answer, whatever solver it comes from. */
#include "qp.h"

/* value = centre - gram multiplier */
static void update_value(qp *self, const real *centre) {
    const qp_problem *problem = self->problem;
    int i, j;
    for (i = 0; i < problem->rows; ++i) self->value[i] = centre[i];
    for (j = 0; j < problem->rows; ++j) {
        const real multiplier = self->multiplier[j];
        int at = j * (j + 1) / 2;
        if (multiplier == REAL(0.0)) continue;
        for (i = 0; i < j; ++i) self->value[i] -= problem->gram[at + i] * multiplier;
        for (at += j; i < problem->rows; ++i) {
            self->value[i] -= problem->gram[at] * multiplier;
            at += i + 1;
        }
    }
}

/* How far the cost of exceeding a bound draws a row back that is `beyond` it, when it may move by t a unit of force. */
static real drawn_back(const qp_problem *problem, int i, real t, real beyond) {
    const real softness = problem->softness[i], paid = beyond - t * problem->price[i];
    if (!(beyond > REAL(0.0))) return REAL(0.0);
    if (!(softness > REAL(0.0) && paid > REAL(0.0))) return beyond;
    return beyond - paid * (softness / (softness + t));
}

/* By how much row i is not where its multiplier asks for: its value against the proximal point of value + t multiplier,
 * t = gram_ii, which it equals if and only if the multiplier is a slope of the cost of exceeding the bounds. (N. Parikh,
 * S. Boyd, "Proximal algorithms", Foundations and Trends in Optimization 1, 2014, section 2.3.) */
static real violation(const qp *self, int i) {
    const qp_problem *problem = self->problem;
    const real multiplier = self->multiplier[i], value = self->value[i];
    real t, push, target;
    /* As most rows are, in short. */
    if (multiplier == REAL(0.0) && value >= problem->lower[i] && value <= problem->upper[i]) return REAL(0.0);
    t = problem->gram[i * (i + 1) / 2 + i];
    push = t * multiplier;
    target = value + push;
    return real_abs(push - drawn_back(problem, i, t, target - problem->upper[i]) +
                    drawn_back(problem, i, t, problem->lower[i] - target));
}

real qp_residual(qp *self, const real *centre) {
    const qp_problem *problem = self->problem;
    real worst = REAL(0.0);
    int i;
    update_value(self, centre);
    for (i = 0; i < problem->rows; ++i) {
        const real off = violation(self, i) * problem->unit[i];
        if (!real_finite(self->value[i]) || !real_finite(off)) return REAL_MAX;
        if (off > worst) worst = off;
    }
    return worst;
}
