/* Replays the recorded vectors, compares every input with the one that Python computed, and times a step. */
#include <math.h>
#include <stdio.h>
#include <time.h>

#include "{{ name }}.h"
#include "vectors.h"

static {{ name }} self;

typedef struct {
    double worst; /* difference, as a share of the bound */
    int sample, clipped, held, iterations;
} outcome;

static outcome replay(int samples) {
    outcome found = {0};
    int t, j, start = 0;
    for (t = 0; t < samples; ++t) {
        real u[{{ NAME }}_INPUTS];
        int status;
        if (start < VECTORS_STARTS && vectors_start[start] == t) {{ name }}_reset(&self, vectors_held[start++]);
        status = {{ name }}_step(&self, vectors_output[t], vectors_reference[t],{{ " vectors_disturbance[t]," if disturbances else "" }} u);
        found.clipped += status == MPC_CLIPPED;
        found.held += status == MPC_HELD;
        if (self.controller.info.iterations > found.iterations) found.iterations = self.controller.info.iterations;
        for (j = 0; j < {{ NAME }}_INPUTS; ++j) {
            const double difference = fabs((double)(u[j] - vectors_input[t][j]) / (double)vectors_scale[j]);
            if (!(difference <= found.worst)) {
                found.worst = difference;
                found.sample = t;
            }
        }
    }
    return found;
}

int main(void) {
    outcome found;
    double seconds;
    int rounds = 0, passed;
    clock_t start;

    {{ name }}_init(&self);
    found = replay(VECTORS_SAMPLES);
    passed = found.worst <= (double)VECTORS_TOLERANCE;
    start = clock();
    do {
        replay(VECTORS_EPISODE);
        rounds += 1;
        seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
    } while (seconds < 0.05);
    printf("%s: %d samples of the episode and %d random ones, %d clipped, %d held, at most %d iterations; largest "
           "difference from Python %.1e of the bound (sample %d), allowed %.0e; %.2f us a step of the episode\n",
           passed ? "passed" : "FAILED", VECTORS_EPISODE, VECTORS_SAMPLES - VECTORS_EPISODE, found.clipped, found.held,
           found.iterations, found.worst, found.sample, (double)VECTORS_TOLERANCE,
           1e6 * seconds / ((double)rounds * VECTORS_EPISODE));
    return passed ? 0 : 1;
}
