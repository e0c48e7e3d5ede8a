/* Times a solver, one solution after the other: time FILE COUNT PARAMETERS INPUTS WARM
 *
 * FILE holds COUNT rows of PARAMETERS doubles. For every byte on standard input, one round over all rows: seconds
 * (COUNT), iterations (COUNT) and answers (COUNT x INPUTS) go to standard output as doubles. Each round begins without
 * earlier solutions; if WARM is 0, each solution does. Before each round goes one like it whose times are
 * not kept, so that memory and clock are at speed, whoever had the turn before.
 */
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "mpc_time.h"

__attribute__((weak)) void solver_prepare(const double *p) { (void)p; }

int main(int arguments, char **argument) {
    if (arguments != 6) return 2;
    const size_t count = (size_t)atoi(argument[2]), parameters = (size_t)atoi(argument[3]);
    const size_t inputs = (size_t)atoi(argument[4]);
    const int warm = atoi(argument[5]);
    double *p = malloc(count * parameters * sizeof *p), *answers = malloc((2 + inputs) * count * sizeof *answers);
    FILE *file = fopen(argument[1], "rb");
    if (!p || !answers || !file || fread(p, sizeof *p, count * parameters, file) != count * parameters) return 2;
    fclose(file);
    double *seconds = answers, *iterations = answers + count, *z = answers + 2 * count;
    solver_setup();
    while (getchar() != EOF) {
        for (int timed = 0; timed < 2; ++timed) {
            solver_forget();
            for (size_t i = 0; i < count; ++i) {
                struct timespec begin, end;
                if (!warm) solver_forget();
                solver_prepare(p + i * parameters);
                clock_gettime(CLOCK_MONOTONIC, &begin);
                const int n = solver_solve(p + i * parameters);
                clock_gettime(CLOCK_MONOTONIC, &end);
                seconds[i] = (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec);
                iterations[i] = n;
                solver_answer(z + i * inputs);
            }
        }
        if (fwrite(answers, sizeof *answers, (2 + inputs) * count, stdout) != (2 + inputs) * count) return 1;
        fflush(stdout);
    }
    free(p);
    free(answers);
    return 0;
}
