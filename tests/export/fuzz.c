/* Calls a controller with whatever can come in, and counts what must not happen.
 *
 * arguments: number of calls. Prints: inputs that were not finite, inputs outside their bounds, changes beyond the rate
 * bounds, statuses that are none, samples refused, clipped and held, and the status after all that, when good
 * samples have come for a while.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "controller.h"
#include "controller_data.h"

static uint64_t seed = 88172645463325252u;

static uint64_t draw(void) {
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return seed;
}

static double uniform(void) { return (double)(draw() >> 11) * (1.0 / 9007199254740992.0); }

static real flipped(real value) {
    unsigned char bytes[sizeof value];
    const unsigned bit = (unsigned)(draw() % (8 * sizeof value));
    memcpy(bytes, &value, sizeof value);
    bytes[bit / 8] = (unsigned char)(bytes[bit / 8] ^ (1u << (bit % 8)));
    memcpy(&value, bytes, sizeof value);
    return value;
}

/* Mostly a sensible number; else one of the ways in which a number goes wrong. */
static real value(real sensible) {
    switch (draw() % 40) {
        case 0: return (real)NAN;
        case 1: return (real)INFINITY;
        case 2: return (real)-INFINITY;
        case 3: return (real)((uniform() - 0.5) * pow(10.0, 76.0 * uniform() - 38.0));
        case 4: return REAL_MAX;
        case 5: return -REAL_MAX;
        case 6: return (real)(1e-40 * uniform());
        case 7: case 8: return flipped(sensible);
        default: return sensible;
    }
}

static controller self;

int main(int count, char **arguments) {
    const long calls = count > 1 ? atol(arguments[1]) : 1000000;
    real y[CONTROLLER_OUTPUTS], r[CONTROLLER_PREVIEW * CONTROLLER_OUTPUTS], u[CONTROLLER_INPUTS];
    real before[CONTROLLER_INPUTS], walk[CONTROLLER_OUTPUTS] = {0};
#ifdef DISTURBED
    real w[CONTROLLER_DISTURBANCES];
#endif
    unsigned long refused = 0, clipped = 0, held = 0;
    long t, wild = 0, outside = 0, hasty = 0, unknown = 0;
    int i, status = -1, known = 0, calm = 0;

    controller_init(&self);
    for (t = 0; t < calls + 400; ++t) {
        const int good = t >= calls;
        if (!good && draw() % 500 == 0) calm = (int)(draw() % 100);
        if (!good && draw() % 1000 == 0) {
            const mpc_info info = controller_info(&self);
            refused += info.refused;
            clipped += info.clipped;
            held += info.held;
            for (i = 0; i < CONTROLLER_INPUTS; ++i) u[i] = value((real)(20.0 * uniform() - 10.0));
            controller_reset(&self, u);
            known = 0;
        }
        for (i = 0; i < CONTROLLER_OUTPUTS; ++i) {
            walk[i] = (real)(0.98 * (double)walk[i] + 0.05 * (uniform() - 0.5));
            y[i] = good ? REAL(0.0) : calm > 0 ? walk[i] : value(walk[i]);
        }
        for (i = 0; i < CONTROLLER_PREVIEW * CONTROLLER_OUTPUTS; ++i)
            r[i] = good ? REAL(0.0) : calm > 0 || draw() % 4 ? (real)(0.3 * (uniform() - 0.5)) : value(REAL(0.05));
#ifdef DISTURBED
        for (i = 0; i < CONTROLLER_DISTURBANCES; ++i) w[i] = good ? REAL(0.0) : value((real)(uniform() - 0.5));
        status = controller_step(&self, y, r, w, u);
#else
        status = controller_step(&self, y, r, u);
#endif
        calm -= 1;
        unknown += status < MPC_OPTIMAL || status > MPC_HELD;
        for (i = 0; i < CONTROLLER_INPUTS; ++i) {
            wild += !real_finite(u[i]);
            outside += !(u[i] >= controller_lower[i] && u[i] <= controller_upper[i]);
#ifdef RATED
            /* Adding a bound to the input before may round. */
            if (known)
                hasty += !(u[i] - before[i] >= controller_slowest[i] * controller_scale[i] * REAL(1.00001) &&
                           u[i] - before[i] <= controller_fastest[i] * controller_scale[i] * REAL(1.00001));
#endif
            before[i] = u[i];
        }
        known = 1;
    }
    printf("%ld %ld %ld %ld %lu %lu %lu %d\n", wild, outside, hasty, unknown, refused, clipped, held, status);
    return known ? 0 : 1;
}
