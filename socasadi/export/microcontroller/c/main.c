/* Serves a controller: takes its arguments from the host, runs one step, returns the answer and what it cost.
 *
 * The build defines LONGEST_CALL, in instructions.
 */
#include <stddef.h>
#include <stdint.h>

#include "firmware.h"
#include "instance.h"
#include "semihosting.h"

#define TIMER(offset) (*(volatile uint32_t *)(0x40000000 + (offset))) /* CMSDK timer 0, counts down */
#define TIMER_CONTROL TIMER(0)
#define TIMER_VALUE TIMER(4)
#define TIMER_RELOAD TIMER(8)

enum { CALIBRATION_TURNS = 1000, CALIBRATION_INSTRUCTIONS = 2 * CALIBRATION_TURNS };

static const uint32_t paint = 0x5A5AA5A5;

static real y[OUTPUTS], reference[PREVIEW * OUTPUTS], w[DISTURBANCES > 0 ? DISTURBANCES : 1], u[INPUTS];

static struct {
    uint32_t begin, end; /* of the timer */
    uint32_t *stack;     /* pointer at the call */
} seen;

static uint32_t between(uint32_t begin, uint32_t end) {
    return (uint32_t)(((uint64_t)(begin - end) * TICKS_DENOMINATOR + TICKS_NUMERATOR / 2) / TICKS_NUMERATOR);
}

/* Two instructions a turn, between two readings. */
static __attribute__((noinline)) uint32_t loop(uint32_t turns) {
    const uint32_t begin = TIMER_VALUE;
    uint32_t end;
    __asm__ volatile("0: subs %0, #1\n\tbne 0b" : "+l"(turns) : : "cc");
    end = TIMER_VALUE;
    return between(begin, end);
}

/* What two readings of the timer cost themselves. */
static uint32_t overhead(void) { return loop(1) - 2; }

/* Whether NAME_step takes w depends on a size that may be an enumerator, which the preprocessor does not see. So both
 * calls are written down, one of them dead. */
typedef void (*any)(void);
typedef int (*step_without_w)(NAME *, const real *, const real *, real *);
typedef int (*step_with_w)(NAME *, const real *, const real *, const real *, real *);

static inline void call(any function) {
    if (DISTURBANCES > 0)
        ((step_with_w)function)(&instance, y, reference, w, u);
    else
        ((step_without_w)function)(&instance, y, reference, u);
}

/* One step between two readings. The count holds the call with its arguments, not the readings. */
static __attribute__((noinline)) void step(void) {
    __asm__ volatile("mov %0, sp" : "=r"(seen.stack));
    seen.begin = TIMER_VALUE;
    call((any)JOIN(NAME, _step));
    seen.end = TIMER_VALUE;
}

/* Fills what is free of the stack, but for the frames of this function and of step. */
static __attribute__((noinline)) void paint_stack(void) {
    uint32_t *word, *pointer;
    __asm__ volatile("mov %0, sp" : "=r"(pointer));
    for (word = stack_bottom; word < pointer; ++word) *word = paint;
}

static uint32_t stack_used(void) {
    const uint32_t *word = stack_bottom;
    while (word < seen.stack && *word == paint) ++word;
    return (uint32_t)((const char *)seen.stack - (const char *)word);
}

static void say(const uint32_t *words, size_t size) { host_write(words, size); }

static void hello(void) {
    const uint32_t words[] = {MESSAGE_HELLO,
                              sizeof(real),
                              OUTPUTS,
                              INPUTS,
                              PREVIEW,
                              DISTURBANCES,
                              loop(CALIBRATION_TURNS) - overhead(),
                              CALIBRATION_INSTRUCTIONS};
    say(words, sizeof words);
}

static void serve_reset(void) {
    const uint32_t words[] = {MESSAGE_RESET};
    host_read(u, sizeof u);
    watch_begin(LONGEST_CALL);
    JOIN(NAME, _reset)(&instance, u);
    watch_end();
    say(words, sizeof words);
}

static void serve_step(void) {
    mpc_info info;

    host_read(y, sizeof y);
    host_read(reference, sizeof reference);
    if (DISTURBANCES > 0) host_read(w, sizeof w);
    paint_stack();
    watch_begin(LONGEST_CALL);
    step();
    watch_end();
    info = JOIN(NAME, _info)(&instance);
    {
        const uint32_t words[] = {MESSAGE_STEP,
                                  between(seen.begin, seen.end) - overhead(),
                                  stack_used(),
                                  (uint32_t)info.status,
                                  (uint32_t)info.iterations,
                                  (uint32_t)info.steps,
                                  (uint32_t)info.clipped,
                                  (uint32_t)info.held,
                                  (uint32_t)info.refused,
                                  (uint32_t)info.worst_iterations};
        const real numbers[] = {info.residual, info.worst_residual};
        say(words, sizeof words);
        host_write(numbers, sizeof numbers);
    }
    host_write(u, sizeof u);
}

void serve(void) {
    TIMER_RELOAD = UINT32_MAX;
    TIMER_VALUE = UINT32_MAX;
    TIMER_CONTROL = 1;
    watch_begin(LONGEST_CALL);
    JOIN(NAME, _init)(&instance);
    watch_end();
    hello();
    for (;;) {
        uint32_t request;
        host_read(&request, sizeof request);
        if (request == MESSAGE_RESET) serve_reset();
        if (request == MESSAGE_STEP) serve_step();
    }
}
