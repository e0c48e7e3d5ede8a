/* The quadratic program of qp.h by OSQP (B. Stellato, G. Banjac, P. Goulart, A. Bemporad, S. Boyd, "OSQP: an operator
 * splitting solver for quadratic programs", Math. Programming Computation 12, 2020), with the code that OSQP's own
 * generator wrote into osqp/.
 *
 * OSQP works on the distance d = z - z_0 from the unconstrained optimum, and slacks:
 *     min d'Hd/2 + sum over soft rows of (price |s| + s^2 / (2 softness))
 *     with  lower - centre <= a'd - s <= upper - centre.
 * Of it only the bounds change from sample to sample, so the factorisation was done when the code was generated. Where
 * price is positive s is the difference of two slacks that are not negative, each a constraint of OSQP's behind the
 * rows.
 *
 * OSQP comes near an answer quickly and to an accurate one slowly. So every few of its iterations the rows that it
 * holds at a bound are taken for the working set, which makes the multipliers the solution of a linear system (what
 * OSQP calls polishing, which the generated code is without). These pass the check of optimality, or OSQP goes on.
 *
 * NOT re-entrant: OSQP's workspace is one, in static memory, and belongs to the one set of tables that it was generated
 * with. Never solve from two threads, or from an interrupt and the main loop. Several controllers with these same
 * tables may take turns, though each then starts from where the other has ended.
 */
#include "qp.h"

#include "osqp.h"
#include "osqp_size.h"
#include "osqp_workspace.h"

#if defined(REAL_FLOAT) && !defined(OSQP_USE_FLOAT)
#error "osqp/ was generated for double: leave REAL_FLOAT undefined"
#elif defined(OSQP_USE_FLOAT) && !defined(REAL_FLOAT)
#error "osqp/ was generated for float: define REAL_FLOAT"
#endif

/* How a row is active; the sign tells the bound, + for the upper one. */
enum { INACTIVE = 0, TIGHT = 1, SLACK = 2 };

/* Up to which a multiplier of OSQP's is rounding, as a share of the largest centre; a pivot says that a row depends on
 * those before it; a residual of the optimality conditions is accepted, again as a share. */
#ifdef REAL_FLOAT
#define TINY 4e-6f
#define DEPENDENT 1e-5f
#define ACCEPTED 5e-5f
#else
#define TINY 1e-10
#define DEPENDENT 1e-11
#define ACCEPTED 1e-8
#endif

/* How often OSQP may be asked to go on (the number of iterations in each is one of its settings), and how often the
 * working set is revised in between by what its own multipliers and rows say. */
#define CALLS 100
#define REVISIONS 3

/* OSQP's names are the same in every export, its code is not: a program with two of them is to fail when it is linked. */
extern const char only_one_osqp_in_a_program;
const char only_one_osqp_in_a_program = 0;

static real from[OSQP_CONSTRAINTS], to[OSQP_CONSTRAINTS];

static int is_soft(const qp_problem *problem, int i) { return problem->softness[i] > REAL(0.0); }

static int is_priced(const qp_problem *problem, int i) { return is_soft(problem, i) && problem->price[i] > REAL(0.0); }

static real larger(real a, real b) { return a > b ? a : b; }

/* Where row i of a lower triangle that holds its diagonal begins. */
static int triangle(int i) { return i * (i + 1) / 2; }

static real gram(const qp_problem *problem, int i, int j) {
    return i < j ? problem->gram[triangle(j) + i] : problem->gram[triangle(i) + j];
}

/* Row i of L, which has i entries. */
static real *factor_row(const qp *self, int i) { return self->factor + i * (i - 1) / 2; }

/* Bounds of OSQP's constraints; false when the problem is not of the shape that the code was generated for. */
static int write_bounds(const qp_problem *problem, const real *centre) {
    const real infinite = (real)OSQP_INFTY;
    int count = problem->rows, i;
    for (i = 0; i < problem->rows; ++i) count += is_priced(problem, i) ? 2 : 0;
    if (count != OSQP_CONSTRAINTS) return 0;
    for (i = 0; i < problem->rows; ++i) {
        from[i] = real_clip(problem->lower[i] - centre[i], -infinite, infinite);
        to[i] = real_clip(problem->upper[i] - centre[i], -infinite, infinite);
    }
    for (; i < count; ++i) {
        from[i] = REAL(0.0);
        to[i] = infinite;
    }
    return 1;
}

/* The working set that these multipliers tell of, the largest first; a row that they leave out and that is beyond a
 * bound by more than `violation` joins. (The multipliers may be self's own.) */
static void choose(qp *self, const real *multiplier, real tiny, real violation) {
    const qp_problem *problem = self->problem;
    int i, k;
    self->active = 0;
    for (i = 0; i < problem->rows; ++i) {
        const real size = real_abs(multiplier[i]);
        const real above = self->value[i] - problem->upper[i], below = problem->lower[i] - self->value[i];
        int side = 0;
        if (size > tiny) side = multiplier[i] > REAL(0.0) ? 1 : -1;
        else if (above > violation) side = 1;
        else if (below > violation) side = -1;
        self->state[i] = side * (is_soft(problem, i) && size >= problem->price[i] ? SLACK : TIGHT);
        if (side == 0) continue;
        for (k = self->active++; k > 0 && real_abs(multiplier[self->row[k - 1]]) < size; --k)
            self->row[k] = self->row[k - 1];
        self->row[k] = i;
    }
}

/* Multipliers with which the rows of the working set are where their states ask for, by L D L' of their gram. A row
 * that depends on those before it, and a multiplier of a sign that does not fit its bound, are left at zero. */
static void polish(qp *self, const real *centre) {
    const qp_problem *problem = self->problem;
    real *x = self->direction;
    int found = self->active, i, j, k;
    for (i = 0; i < problem->rows; ++i) self->multiplier[i] = REAL(0.0);
    self->active = 0;
    for (k = 0; k < found; ++k) {
        const int row = self->row[k], n = self->active, upper = self->state[row] > 0;
        const int exceeds = self->state[row] == SLACK || self->state[row] == -SLACK;
        const real softness = exceeds ? problem->softness[row] : REAL(0.0);
        const real priced = upper ? softness * problem->price[row] : -softness * problem->price[row];
        real *entries = factor_row(self, n), pivot = gram(problem, row, row) + softness;
        real rest = centre[row] - (upper ? problem->upper[row] : problem->lower[row]) + priced;
        for (i = 0; i < n; ++i) {
            const real *left = factor_row(self, i);
            real sum = gram(problem, row, self->row[i]);
            for (j = 0; j < i; ++j) sum -= left[j] * entries[j];
            entries[i] = sum;
        }
        for (i = 0; i < n; ++i) {
            const real scaled = entries[i] / self->diagonal[i];
            pivot -= entries[i] * scaled;
            entries[i] = scaled;
            rest -= scaled * x[i];
        }
        if (!(pivot > DEPENDENT)) continue;
        self->row[n] = row;
        self->diagonal[n] = pivot;
        x[n] = rest;
        self->active += 1;
    }
    for (i = 0; i < self->active; ++i) x[i] /= self->diagonal[i];
    for (k = self->active - 1; k >= 0; --k) {
        const real *entries = factor_row(self, k);
        const int row = self->row[k];
        for (i = 0; i < k; ++i) x[i] -= entries[i] * x[k];
        if ((x[k] > REAL(0.0)) == (self->state[row] > 0)) self->multiplier[row] = x[k];
    }
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
    int i;
    self->active = 0;
    self->iterations = 0;
    for (i = 0; i < self->problem->rows; ++i) {
        self->state[i] = INACTIVE;
        self->multiplier[i] = REAL(0.0);
    }
    osqp_cold_start(&osqp_solver);
}

int qp_solve(qp *self, const real *centre) {
    const qp_problem *problem = self->problem;
    const real *dual = osqp_solver.solution->y;
    real scaled = REAL(1.0), size = REAL(1.0);
    int status = QP_CAPPED, i, calls;
    self->iterations = 0;
    for (i = 0; i < problem->rows; ++i) {
        if (!real_finite(centre[i])) return QP_CAPPED;
        self->value[i] = centre[i];
        scaled = larger(scaled, real_abs(centre[i]));
        size = larger(size, real_abs(centre[i]) * problem->unit[i]);
    }
    if (!write_bounds(problem, centre) || osqp_update_data_vec(&osqp_solver, 0, from, to) != 0) return QP_CAPPED;
    for (calls = 0; calls < CALLS; ++calls) {
        const int failed = osqp_solve(&osqp_solver) != 0, said = (int)osqp_solver.info->status_val;
        self->iterations += (int)osqp_solver.info->iter;
        if (said == OSQP_PRIMAL_INFEASIBLE) status = QP_INFEASIBLE;
        if (failed || said == OSQP_PRIMAL_INFEASIBLE || said == OSQP_NON_CVX) break;
        choose(self, dual, TINY * scaled, REAL_MAX);
        polish(self, centre);
        if (qp_residual(self, centre) <= ACCEPTED * size) return QP_OPTIMAL;
        for (i = 0; i < REVISIONS; ++i) {
            choose(self, self->multiplier, REAL(0.0), ACCEPTED * scaled);
            polish(self, centre);
            if (qp_residual(self, centre) <= ACCEPTED * size) return QP_OPTIMAL;
        }
    }
    /* OSQP's own multipliers may pass where rows depend on each other; as a start for the next solution they do not. */
    for (i = 0; i < problem->rows; ++i) {
        const real own = dual[i];
        self->multiplier[i] = real_finite(own) && real_abs(own) > TINY * scaled ? own : REAL(0.0);
    }
    osqp_cold_start(&osqp_solver);
    return status;
}
