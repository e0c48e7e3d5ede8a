/* Replays the recorded episode and compares every tension with the one that Python computed. */
#include <math.h>
#include <stdio.h>

#include "controller.h"
#include "episode.h"

int main(void) {
    controller self;
    double u[CONTROLLER_INPUTS], worst = 0.0;
    int t, j, worst_sample = 0;

    if (controller_init(&self)) {
        puts("no memory for the solver");
        return 1;
    }
    controller_reset(&self, episode_held);
    for (t = 0; t < EPISODE_SAMPLES; ++t) {
        controller_step(&self, episode_output[t], episode_preview[t], u);
        for (j = 0; j < CONTROLLER_INPUTS; ++j) {
            const double difference = fabs(u[j] - episode_tension[t][j]);
            if (!(difference <= worst)) {
                worst = difference;
                worst_sample = t;
            }
        }
    }
    printf("%d samples, %lu clipped, %lu held; largest difference from Python %.3e N (sample %d), allowed %.0e N\n",
           EPISODE_SAMPLES, self.clipped, self.held, worst, worst_sample, EPISODE_TOLERANCE);
    controller_free(&self);
    return worst <= EPISODE_TOLERANCE ? 0 : 1;
}
