/* The task, which no trial changes: what is wanted of the outputs at t = 0, 1, ... samples, and beyond the end for the
 * controller to look ahead, row after row. */
#ifndef {{ NAME }}_TASK_H
#define {{ NAME }}_TASK_H

#include "real.h"

#define {{ NAME }}_TASK_SAMPLES {{ samples }}

static const real {{ name }}_task[{{ reference.size }}] = {{ reference.ravel() | c }};

#endif
