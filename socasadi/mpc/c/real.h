/* The number type of the controller: double, or float with -DREAL_FLOAT. */
#ifndef REAL_H
#define REAL_H

#include <float.h>

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "the checks rely on NaN and infinities: compile without -ffast-math and -ffinite-math-only"
#endif

#ifdef REAL_FLOAT
typedef float real;
#define REAL_MAX FLT_MAX
#define REAL(literal) literal##f
#else
typedef double real;
#define REAL_MAX DBL_MAX
#define REAL(literal) literal
#endif

static inline real real_abs(real value) { return value < REAL(0.0) ? -value : value; }

static inline real real_clip(real value, real lower, real upper) {
    return value < lower ? lower : value > upper ? upper : value;
}

/* False for NaN and infinities. (Not isfinite: this compares in the type itself and needs no math library.) */
static inline int real_finite(real value) { return value >= -REAL_MAX && value <= REAL_MAX; }

#endif
