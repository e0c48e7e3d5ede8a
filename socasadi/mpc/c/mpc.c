#include "mpc.h"

/* out += matrix x, the matrix (rows x columns) row after row */
static void add_product(real *out, const real *matrix, const real *x, int rows, int columns) {
    int i, j;
    for (i = 0; i < rows; ++i) {
        real sum = out[i];
        for (j = 0; j < columns; ++j) sum += matrix[j] * x[j];
        out[i] = sum;
        matrix += columns;
    }
}

static int all_finite(const real *values, int count) {
    int i;
    for (i = 0; i < count; ++i)
        if (!real_finite(values[i])) return 0;
    return 1;
}

static void copy(real *to, const real *from, int count) {
    int i;
    for (i = 0; i < count; ++i) to[i] = from[i];
}

static void fill(real *values, real value, int count) {
    int i;
    for (i = 0; i < count; ++i) values[i] = value;
}

/* out = what is to be measured where the observer's state is x */
static void expect(const mpc *self, const real *x, real *out) {
    const mpc_data *data = self->data;
    const int p = data->outputs;
    fill(out, REAL(0.0), p);
    add_product(out, data->C, x, p, data->order);
    add_product(out, data->D, self->v, p, data->inputs);
    add_product(out, data->F, self->w, p, data->disturbances);
}

static int plausible(const mpc_data *data, const real *y) {
    int i;
    for (i = 0; i < data->outputs; ++i)
        if (!(real_abs(y[i]) < data->plausible)) return 0;
    return 1;
}

/* x of a robot that rests under the last input, undisturbed as far as is known */
static void rest(mpc *self) {
    fill(self->x, REAL(0.0), self->data->order);
    add_product(self->x, self->data->rest, self->v, self->data->order, self->data->inputs);
}

/* Predicts x with what was applied, and corrects it by y where y can be. An observer that expects what cannot be, after
 * whatever fault, starts anew from rest. */
static void observe(mpc *self, const real *y) {
    const mpc_data *data = self->data;
    const int n = data->order;
    int i;
    fill(self->predicted, REAL(0.0), n);
    add_product(self->predicted, data->A, self->x, n, n);
    add_product(self->predicted, data->B, self->v, n, data->inputs);
    add_product(self->predicted, data->E, self->w, n, data->disturbances);
    expect(self, self->predicted, self->innovation);
    if (plausible(data, self->innovation)) {
        copy(self->x, self->predicted, n);
    } else {
        rest(self);
        expect(self, self->x, self->innovation);
    }
    if (plausible(data, y)) {
        for (i = 0; i < data->outputs; ++i) self->innovation[i] = y[i] - self->innovation[i];
        add_product(self->x, data->gain, self->innovation, n, data->outputs);
    } else {
        self->info.refused += 1;
    }
}

/* The rows of the quadratic program where its bounds do not bind. */
static void centre(mpc *self, const real *reference) {
    const mpc_data *data = self->data;
    const int n = data->order, m = data->inputs, previewed = data->preview * data->outputs, rows = data->qp.rows;
    const int count = MPC_PARAMETERS(n, m, data->outputs, data->disturbances, data->preview);
    real *parameter = self->parameters;
    const real *column = data->map;
    int i, j;
    copy(parameter, self->x, n);
    copy(parameter + n, self->v, m);
    copy(parameter + n + m, reference, previewed);
    copy(parameter + n + m + previewed, self->w, data->disturbances);
    parameter[count - 1] = REAL(1.0);
    fill(self->centre, REAL(0.0), rows);
    for (j = 0; j < count; ++j) {
        for (i = 0; i < rows; ++i) self->centre[i] += column[i] * parameter[j];
        column += rows;
    }
}

/* Writes the input that the quadratic program asks for, as far as it can be believed, to v: an enum mpc_status. What is
 * not finite, be it in the reference, comes out of the program as a residual that is not believed. */
static int decide(mpc *self, const real *reference, real *v) {
    const mpc_data *data = self->data;
    const int m = data->inputs;
    int i, warm;
    centre(self, reference);
    self->info.iterations = 0;
    do {
        warm = self->solver.active > 0;
        qp_solve(&self->solver, self->centre);
        self->info.iterations += self->solver.iterations;
        self->info.residual = qp_residual(&self->solver, self->centre);
        if (self->info.residual <= data->tolerance) {
            for (i = 0; i < m; ++i) v[i] = self->solver.value[i] * data->qp.unit[i];
            return MPC_OPTIMAL;
        }
        /* A working set that led nowhere is not to be started from: once more without one. */
        qp_reset(&self->solver);
    } while (warm);
    for (i = 0; i < m; ++i) v[i] = self->centre[i] * data->qp.unit[i];
    if (all_finite(v, m)) return MPC_CLIPPED;
    copy(v, self->v, m);
    return MPC_HELD;
}

static void count(mpc_info *info, int status) {
    info->status = status;
    info->steps += 1;
    info->clipped += status == MPC_CLIPPED;
    info->held += status == MPC_HELD;
    if (info->iterations > info->worst_iterations) info->worst_iterations = info->iterations;
    if (status == MPC_OPTIMAL && info->residual > info->worst_residual) info->worst_residual = info->residual;
}

void mpc_init(mpc *self, const mpc_data *data, real *reals, int *ints) {
    const int n = data->order, m = data->inputs, p = data->outputs, k = data->disturbances;
    self->data = data;
    self->x = reals;
    self->v = self->x + n;
    self->w = self->v + m;
    self->predicted = self->w + k;
    self->innovation = self->predicted + n;
    self->parameters = self->innovation + p;
    self->centre = self->parameters + MPC_PARAMETERS(n, m, p, k, data->preview);
    qp_init(&self->solver, &data->qp, self->centre + data->qp.rows, ints);
    fill(self->v, REAL(0.0), m);
    mpc_reset(self, self->v);
}

void mpc_reset(mpc *self, const real *u_before) {
    static const mpc_info none = {0};
    const mpc_data *data = self->data;
    int i;
    for (i = 0; i < data->inputs; ++i) self->v[i] = real_finite(u_before[i]) ? u_before[i] / data->scale[i] : REAL(0.0);
    rest(self);
    fill(self->w, REAL(0.0), data->disturbances);
    self->info = none;
    qp_reset(&self->solver);
}

int mpc_step(mpc *self, const real *y, const real *reference, const real *w, real *u) {
    const mpc_data *data = self->data;
    const int m = data->inputs;
    /* The first rows of the program are the input, so that their bounds are those of v. */
    const real *unit = data->qp.unit, *lower = data->qp.lower, *upper = data->qp.upper;
    int i, status;
    observe(self, y);
    for (i = 0; i < data->disturbances; ++i)
        if (real_finite(w[i])) self->w[i] = w[i];
    for (i = 0; i < m; ++i) self->v[i] = real_clip(self->v[i], lower[i] * unit[i], upper[i] * unit[i]);
    status = decide(self, reference, u);
    for (i = 0; i < m; ++i) {
        real v = u[i];
        if (data->slowest) v = real_clip(v, self->v[i] + data->slowest[i], self->v[i] + data->fastest[i]);
        self->v[i] = real_clip(v, lower[i] * unit[i], upper[i] * unit[i]);
        /* Scaling back can round across a bound. */
        u[i] = real_clip(self->v[i] * data->scale[i], data->lower[i], data->upper[i]);
    }
    count(&self->info, status);
    return status;
}
