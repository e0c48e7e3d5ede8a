/* One experiment of a campaign: flies the task with the controller, and prints the recording for `socasadi tell`.
 *
 * Compile it with the C files of this folder, a file of yours that defines robot_start and robot_hold, and the folder
 * of the trial, which holds {{ name }}_data.h, on the path of headers. */
#include <stdio.h>

#include "experiment.h"
#include "{{ name }}_task.h"

static {{ name }} self;

static void heading(const char *name, int count) {
    int i;
    for (i = 1; i <= count; ++i) printf(",%s%d", name, i);
}

static void numbers(const real *values, int count) {
    int i;
    for (i = 0; i < count; ++i) {
        if (values)
            printf(",%.17g", (double)values[i]);
        else
            printf(",");
    }
}

/* A line of the recording; what is null is left empty. */
static void line(int t, const real *y, const real *u, const real *r{{ ", const real *w" if disturbances else "" }}) {
    printf("%.17g", t * (double){{ NAME }}_SAMPLE_TIME);
    numbers(y, {{ NAME }}_OUTPUTS);
    numbers(u, {{ NAME }}_INPUTS);
    numbers(r, {{ NAME }}_OUTPUTS);
{% if disturbances %}    numbers(w, {{ NAME }}_DISTURBANCES);
{% endif %}    printf("\n");
}

int main(void) {
    real y[{{ NAME }}_OUTPUTS] = {0}, u[{{ NAME }}_INPUTS] = {0};
{% if disturbances %}    real w[{{ NAME }}_DISTURBANCES] = {0}, w_before[{{ NAME }}_DISTURBANCES];
{% endif %}    int t, i, failed;

    printf("t");
    heading("y", {{ NAME }}_OUTPUTS);
    heading("u", {{ NAME }}_INPUTS);
    heading("r", {{ NAME }}_OUTPUTS);
{% if disturbances %}    heading("w", {{ NAME }}_DISTURBANCES);
{% endif %}    printf("\n");

    {{ name }}_init(&self);
    failed = robot_start(y, u{{ ", w" if disturbances else "" }});
    if (!failed) {
        {{ name }}_reset(&self, u);
        line(-1, 0, u, 0{{ ", 0" if disturbances else "" }}); /* the inputs before the first sample */
    }
    for (t = 0; !failed && t < {{ NAME }}_TASK_SAMPLES; ++t) {
        real measured[{{ NAME }}_OUTPUTS] = {0};
{% if disturbances %}        for (i = 0; i < {{ NAME }}_DISTURBANCES; ++i) w_before[i] = w[i];
{% endif %}        {{ name }}_step(&self, y, &{{ name }}_task[(t + 1) * {{ NAME }}_OUTPUTS],{{ " w," if disturbances else "" }} u);
        failed = robot_hold(u, measured{{ ", w" if disturbances else "" }});
        line(t, y, u, &{{ name }}_task[t * {{ NAME }}_OUTPUTS]{{ ", w_before" if disturbances else "" }});
        for (i = 0; i < {{ NAME }}_OUTPUTS; ++i) y[i] = measured[i];
    }
    if (failed) {
        fprintf(stderr, "the experiment failed: tell it by `socasadi tell RUN --trial N --failed REASON`\n");
        return 1;
    }
    line(t, y, 0, &{{ name }}_task[t * {{ NAME }}_OUTPUTS]{{ ", 0" if disturbances else "" }});
    return 0;
}
