/* Dual active-set method with recursive LDL' updates.
 *
 * D. Arnstrom, A. Bemporad, D. Axehill, "A dual active-set solver for embedded quadratic programming using recursive
 * LDL' updates", IEEE Trans. Automatic Control 67 (2022); the order of steps within an iteration, and with it the
 * treatment of dependent rows, is that of D. Goldfarb, A. Idnani, "A numerically stable dual method for solving strictly
 * convex quadratic programs", Math. Programming 27 (1983).
 *
 * All along, the multipliers of the working set are optimal for it and have their right signs. The row that is violated
 * most joins: its multiplier grows from zero, those of the working set answer so that their rows stay at their bounds,
 * and whatever multiplier meets the end of its range on the way changes its state or leaves. Each step raises the
 * dual objective, so that no working set comes twice; rounding is guarded against by the cap of iterations.
 */
#include "qp.h"

/* How a row is active; the sign tells the bound, + for the upper one. */
enum {
    INACTIVE = 0, /* multiplier 0 */
    TIGHT = 1,    /* the row is at its bound; of a soft row, the multiplier is not above its price */
    SLACK = 2,    /* of soft rows: the bound is exceeded by softness (multiplier - price) */
    NEGLECTED = 3 /* multiplier 0: exceeds its bound by next to nothing, and cannot join for others that it hangs on */
};

#ifdef REAL_FLOAT
#define TOLERANCE 2e-6f  /* of a row, relative to the largest centre */
#define NEXT_TO_NOTHING 2e-5f
#define DEPENDENT 1e-5f  /* of a row of unit length, the square of what is left of it beside the working set */
#define NO_DIRECTION 1e-3f
#else
#define TOLERANCE 1e-11
#define NEXT_TO_NOTHING 1e-7
#define DEPENDENT 1e-11
#define NO_DIRECTION 3e-6
#endif

static int side(int state) { return state < 0 ? -1 : 1; }

static int is_slack(int state) { return state == SLACK || state == -SLACK; }

/* Where row i of a lower triangle that holds its diagonal begins. */
static int triangle(int i) { return i * (i + 1) / 2; }

static real gram(const qp_problem *problem, int i, int j) {
    return i < j ? problem->gram[triangle(j) + i] : problem->gram[triangle(i) + j];
}

/* Row i of L, which has i entries. */
static real *factor_row(const qp *self, int i) { return self->factor + i * (i - 1) / 2; }

/* The bound at which an active row is. */
static real bound(const qp_problem *problem, int i, int state) {
    return state < 0 ? problem->lower[i] : problem->upper[i];
}

/* By how much an active row's value differs from what its state and multiplier ask for, positive outwards. */
static real excess(const qp *self, int i) {
    const qp_problem *problem = self->problem;
    const int state = self->state[i];
    const real beyond = (real)side(state) * (self->value[i] - bound(problem, i, state));
    if (!is_slack(state)) return beyond;
    return beyond - problem->softness[i] * ((real)side(state) * self->multiplier[i] - problem->price[i]);
}

/* value = centre - gram multiplier */
static void update_value(qp *self, const real *centre) {
    const qp_problem *problem = self->problem;
    int i, k;
    for (i = 0; i < problem->rows; ++i) self->value[i] = centre[i];
    for (k = 0; k < self->active; ++k) {
        const int w = self->row[k];
        const real multiplier = self->multiplier[w];
        int at = triangle(w);
        for (i = 0; i < w; ++i) self->value[i] -= problem->gram[at + i] * multiplier;
        for (at += w; i < problem->rows; ++i) {
            self->value[i] -= problem->gram[at] * multiplier;
            at += i + 1;
        }
    }
}

/* The same for the rows of the working set alone. */
static void update_active(qp *self, const real *centre) {
    int k, l;
    for (k = 0; k < self->active; ++k) {
        const int i = self->row[k];
        const real multiplier = self->multiplier[i];
        real value = centre[i] - gram(self->problem, i, i) * multiplier;
        for (l = 0; l < k; ++l) {
            const int j = self->row[l];
            const real entry = gram(self->problem, i, j);
            value -= entry * self->multiplier[j];
            self->value[j] -= entry * multiplier;
        }
        self->value[i] = value;
    }
}

/* x <- L^-T x */
static void solve_transposed(const qp *self, real *x) {
    int i, k;
    for (k = self->active - 1; k > 0; --k) {
        const real *entries = factor_row(self, k), last = x[k];
        for (i = 0; i < k; ++i) x[i] -= entries[i] * last;
    }
}

/* Prepares row j, in the given state, as the last of the working set: writes its row of L, returns its entry of D. */
static real extend(qp *self, int j, int state) {
    real *entries = factor_row(self, self->active);
    real rest = gram(self->problem, j, j) + (is_slack(state) ? self->problem->softness[j] : REAL(0.0));
    int i, k;
    for (k = 0; k < self->active; ++k) {
        const real *left = factor_row(self, k);
        real sum = gram(self->problem, self->row[k], j);
        for (i = 0; i < k; ++i) sum -= left[i] * entries[i];
        entries[k] = sum;
    }
    for (k = 0; k < self->active; ++k) {
        const real scaled = entries[k] / self->diagonal[k];
        rest -= entries[k] * scaled;
        entries[k] = scaled;
    }
    return rest;
}

/* Lets row j, which has been prepared, join. */
static void append(qp *self, int j, int state, real diagonal) {
    self->diagonal[self->active] = diagonal;
    self->row[self->active] = j;
    self->state[j] = state;
    self->active += 1;
}

/* Takes the k-th of the working set out; L and D of the others follow by a rank-one update (Gill, Golub, Murray,
 * Saunders, "Methods for modifying matrix factorizations", Math. Computation 28, 1974, method C1). */
static void take_out(qp *self, int k) {
    real *column = self->direction, weight = self->diagonal[k];
    int i, j;
    for (i = k + 1; i < self->active; ++i) {
        const real *old = factor_row(self, i);
        real *moved = factor_row(self, i - 1);
        column[i - 1] = old[k];
        for (j = 0; j < k; ++j) moved[j] = old[j];
        for (j = k; j < i - 1; ++j) moved[j] = old[j + 1];
        self->row[i - 1] = self->row[i];
        self->diagonal[i - 1] = self->diagonal[i];
    }
    self->active -= 1;
    for (j = k; j < self->active; ++j) {
        const real head = column[j], old = self->diagonal[j], updated = old + weight * head * head;
        const real share = weight * head / updated;
        self->diagonal[j] = updated;
        weight *= old / updated;
        for (i = j + 1; i < self->active; ++i) {
            real *entry = factor_row(self, i) + j;
            column[i] -= head * *entry;
            *entry += share * column[i];
        }
    }
}

/* Gives the k-th of the working set another state. */
static void change(qp *self, int k, int state) {
    const int j = self->row[k];
    real diagonal;
    take_out(self, k);
    diagonal = extend(self, j, state);
    append(self, j, state, diagonal > DEPENDENT ? diagonal : DEPENDENT);
}

/* The k-th multiplier has met the lower end of its range, or the upper one. */
static void leave_range(qp *self, int k, int upper) {
    const int j = self->row[k], state = self->state[j];
    const real price = self->problem->price[j];
    if (upper) {
        self->multiplier[j] = (real)side(state) * price;
        change(self, k, side(state) * SLACK);
    } else if (is_slack(state) && price > REAL(0.0)) {
        self->multiplier[j] = (real)side(state) * price;
        change(self, k, side(state) * TIGHT);
    } else {
        self->multiplier[j] = REAL(0.0);
        self->state[j] = INACTIVE;
        take_out(self, k);
    }
}

/* Range of a multiplier in its state, as a magnitude. */
static real range_from(const qp_problem *problem, int i, int state) {
    return is_slack(state) ? problem->price[i] : REAL(0.0);
}

static real range_to(const qp_problem *problem, int i, int state) {
    return !is_slack(state) && problem->softness[i] > REAL(0.0) ? problem->price[i] : REAL_MAX;
}

static real largest_excess(const qp *self) {
    real largest = REAL(0.0);
    int k;
    for (k = 0; k < self->active; ++k) {
        const real size = real_abs(excess(self, self->row[k]));
        if (size > largest) largest = size;
    }
    return largest;
}

/* Newton's step of the working set's multipliers towards their rows' bounds: exact but for rounding. */
static void correct(qp *self) {
    real *x = self->direction;
    int i, k;
    for (k = 0; k < self->active; ++k) {
        const real *entries = factor_row(self, k);
        const int j = self->row[k];
        x[k] = (real)side(self->state[j]) * excess(self, j);
        for (i = 0; i < k; ++i) x[k] -= entries[i] * x[i];
    }
    for (k = 0; k < self->active; ++k) x[k] /= self->diagonal[k];
    solve_transposed(self, x);
    for (k = 0; k < self->active; ++k) self->multiplier[self->row[k]] += x[k];
}

/* Empties the working set. */
static void forget(qp *self) {
    int i;
    self->active = 0;
    for (i = 0; i < self->problem->rows; ++i) {
        self->state[i] = INACTIVE;
        self->multiplier[i] = REAL(0.0);
    }
}

/* Multipliers of the working set for these centres. Those that fall out of their range change or leave, the farthest
 * first, until none does; when that takes too long the working set is given up. */
static void settle(qp *self, const real *centre) {
    const qp_problem *problem = self->problem;
    int patience = self->iterations + 2 * self->active, k;
    if (patience > problem->iterations) patience = problem->iterations;
    while (self->active > 0) {
        real farthest = REAL(0.0);
        int worst = -1, upper = 0;
        update_active(self, centre);
        correct(self);
        for (k = 0; k < self->active; ++k) {
            const int j = self->row[k], state = self->state[j];
            const real size = (real)side(state) * self->multiplier[j];
            const real below = range_from(problem, j, state) - size, above = size - range_to(problem, j, state);
            if (below > farthest) {
                farthest = below;
                worst = k;
                upper = 0;
            }
            if (above > farthest) {
                farthest = above;
                worst = k;
                upper = 1;
            }
        }
        if (worst < 0) break;
        if (self->iterations >= patience) {
            forget(self);
            break;
        }
        self->iterations += 1;
        leave_range(self, worst, upper);
    }
    update_value(self, centre);
}

/* The inactive row that is farthest out of its bounds by more than the tolerance, -1 when there is none. */
static int most_violated(const qp *self, real tolerance, int *at) {
    const qp_problem *problem = self->problem;
    real farthest = tolerance;
    int i, found = -1;
    for (i = 0; i < problem->rows; ++i) {
        const real above = self->value[i] - problem->upper[i], below = problem->lower[i] - self->value[i];
        if (self->state[i] != INACTIVE) continue;
        if (above > farthest) {
            farthest = above;
            found = i;
            *at = 1;
        }
        if (below > farthest) {
            farthest = below;
            found = i;
            *at = -1;
        }
    }
    return found;
}

/* Where a step of the multipliers ends. */
typedef struct {
    real length;
    int first; /* position in the working set of the multiplier that meets the end of its range; -1: none does */
    int upper; /* whether that is the upper end */
} halt;

/* While the multiplier of a row grows outwards from its bound `at`, those of the working set move along `direction`;
 * what moves at less than the least pace does not move. */
static halt first_halt(const qp *self, int at, real length, real least) {
    halt found = {0};
    int k;
    found.length = length;
    found.first = -1;
    for (k = 0; k < self->active; ++k) {
        const int i = self->row[k], sign = side(self->state[i]);
        const real rate = (real)(-at * sign) * self->direction[k], size = (real)sign * self->multiplier[i];
        const int grows = rate > REAL(0.0);
        const real pace = grows ? rate : -rate;
        real room = grows ? range_to(self->problem, i, self->state[i]) - size
                          : size - range_from(self->problem, i, self->state[i]);
        if (room < REAL(0.0)) room = REAL(0.0);
        if (pace > least && room < REAL_MAX && room < pace * found.length) {
            found.length = room / pace;
            found.first = k;
            found.upper = grows;
        }
    }
    return found;
}

/* Lets the violated row j join at its bound `at`, +1 the upper and -1 the lower one: an enum qp_status. */
static int join(qp *self, int j, int at) {
    const qp_problem *problem = self->problem;
    const int soft = problem->softness[j] > REAL(0.0);
    int state = at * (soft && !(problem->price[j] > REAL(0.0)) ? SLACK : TIGHT), k;
    real beyond = (real)at * (self->value[j] - bound(problem, j, state)), size = REAL(0.0);

    while (self->iterations < problem->iterations) {
        const real slope = extend(self, j, state), *entries = factor_row(self, self->active);
        const int joins = slope > DEPENDENT;
        const real full = joins ? beyond / slope : REAL_MAX, turn = range_to(problem, j, state) - size;
        halt stop;
        self->iterations += 1;
        for (k = 0; k < self->active; ++k) self->direction[k] = entries[k];
        solve_transposed(self, self->direction);
        stop = first_halt(self, at, full < turn ? full : turn, joins ? REAL(0.0) : NO_DIRECTION);
        if (stop.length >= REAL_MAX) return QP_INFEASIBLE;
        for (k = 0; k < self->active; ++k)
            self->multiplier[self->row[k]] -= (real)at * stop.length * self->direction[k];
        size += stop.length;
        beyond -= stop.length * slope;
        if (stop.first >= 0) {
            leave_range(self, stop.first, stop.upper);
        } else if (full < turn) {
            self->multiplier[j] = (real)at * size;
            append(self, j, state, slope);
            return QP_OPTIMAL;
        } else {
            state = at * SLACK;
        }
    }
    return QP_CAPPED;
}

void qp_init(qp *self, const qp_problem *problem, real *reals, int *ints) {
    const int rows = problem->rows;
    self->problem = problem;
    self->value = reals;
    self->multiplier = reals + rows;
    self->diagonal = reals + 2 * rows;
    self->direction = reals + 3 * rows;
    self->factor = reals + 4 * rows;
    self->row = ints;
    self->state = ints + rows;
    qp_reset(self);
}

void qp_reset(qp *self) {
    forget(self);
    self->iterations = 0;
}

int qp_solve(qp *self, const real *centre) {
    real scale = REAL(1.0), tolerance;
    int corrections = 2, i;
    for (i = 0; i < self->problem->rows; ++i) {
        const real size = real_abs(centre[i]);
        if (size > scale) scale = size;
        if (self->state[i] == NEGLECTED) self->state[i] = INACTIVE;
    }
    tolerance = TOLERANCE * scale;
    self->iterations = 0;
    settle(self, centre);
    for (;;) {
        int at = 0;
        const int j = most_violated(self, tolerance, &at);
        if (j < 0) {
            if (largest_excess(self) <= tolerance || corrections-- == 0) return QP_OPTIMAL;
            settle(self, centre);
        } else {
            const real value = self->value[j];
            const real beyond = at > 0 ? value - self->problem->upper[j] : self->problem->lower[j] - value;
            const int status = join(self, j, at);
            if (status == QP_INFEASIBLE && beyond <= NEXT_TO_NOTHING * scale)
                self->state[j] = NEGLECTED;
            else if (status != QP_OPTIMAL)
                return status;
            update_value(self, centre);
        }
    }
}
