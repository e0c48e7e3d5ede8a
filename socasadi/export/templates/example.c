/* The controller in use: replace what is marked by your sensor, your reference, your actuators and your clock. */
#include <stdio.h>

#include "{{ name }}.h"

static {{ name }} self;

int main(void) {
    real y[{{ NAME }}_OUTPUTS] = {0}, r[{{ NAME }}_PREVIEW * {{ NAME }}_OUTPUTS] = {0}, u[{{ NAME }}_INPUTS] = {0};
{% if disturbances %}    real w[{{ NAME }}_DISTURBANCES] = {0};
{% endif %}    int t, j;

    {{ name }}_init(&self);
    {{ name }}_reset(&self, u); /* the inputs under which the robot rests now */
    for (t = 0; t < 10; ++t) {
        /* Here: wait for the next tick of {{ NAME }}_SAMPLE_TIME; read y; write what is wanted from now on to r. */
        const int status = {{ name }}_step(&self, y, r,{{ " w," if disturbances else "" }} u);
        /* Here: apply u until the next tick. */
        printf("%d:", t);
        for (j = 0; j < {{ NAME }}_INPUTS; ++j) printf(" %8.4f", (double)u[j]);
        printf("  status %d\n", status);
    }
    return 0;
}
