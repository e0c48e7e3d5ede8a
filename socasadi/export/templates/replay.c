/* Replays the recorded episode, compares every input with the one that Python computed, and times a step. */
#include <math.h>
#include <stdio.h>
#include <time.h>

#include "{{ name }}.h"
#include "vectors.h"

static {{ name }} self;

static double replay(int *worst_sample) {
    double worst = 0.0;
    int t, j;
    {{ name }}_reset(&self, vectors_held);
    for (t = 0; t < VECTORS_SAMPLES; ++t) {
        real u[{{ NAME }}_INPUTS];
        {{ name }}_step(&self, vectors_output[t], vectors_reference[t],{{ " vectors_disturbance[t]," if disturbances else "" }} u);
        for (j = 0; j < {{ NAME }}_INPUTS; ++j) {
            const double difference = fabs((double)(u[j] - vectors_input[t][j]) / (double)vectors_scale[j]);
            if (!(difference <= worst)) {
                worst = difference;
                *worst_sample = t;
            }
        }
    }
    return worst;
}

int main(void) {
    int sample = 0, rounds = 0;
    double worst, seconds;
    mpc_info info;
    clock_t start;

    {{ name }}_init(&self);
    worst = replay(&sample);
    info = {{ name }}_info(&self);
    start = clock();
    do {
        int ignored;
        replay(&ignored);
        rounds += 1;
        seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
    } while (seconds < 0.05);
    printf("%d samples, %lu clipped, %lu held, at most %d iterations; largest difference from Python %.1e of the bound "
           "(sample %d), allowed %.0e; %.2f us a step\n",
           VECTORS_SAMPLES, info.clipped, info.held, info.worst_iterations, worst, sample, (double)VECTORS_TOLERANCE,
           1e6 * seconds / ((double)rounds * VECTORS_SAMPLES));
    return worst <= (double)VECTORS_TOLERANCE ? 0 : 1;
}
