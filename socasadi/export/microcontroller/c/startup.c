/* From power-up to main without a C library, and what is said about a program that cannot go on. */
#include <stdint.h>

#include "firmware.h"
#include "semihosting.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define SYSTICK_CONTROL REGISTER(0xE000E010)
#define SYSTICK_RELOAD REGISTER(0xE000E014)
#define SYSTICK_VALUE REGISTER(0xE000E018)
#define CPACR REGISTER(0xE000ED88)
#define CFSR REGISTER(0xE000ED28)
#define MMFAR REGISTER(0xE000ED34)
#define BFAR REGISTER(0xE000ED38)
#define MPU_CONTROL REGISTER(0xE000ED94)
#define MPU_BASE REGISTER(0xE000ED9C)
#define MPU_SIZE REGISTER(0xE000EDA0)

enum { SYSTICK_PERIOD = 0x1000000, SYSTICK_ON = 7, FPU_FULL_ACCESS = 0xF << 20 };
enum { HANDLER_STACK_WORDS = 512 };

/* Of the memory protection unit: region 1 lies over region 0. Access rights are bits 26 to 24, log2(bytes) - 1 bits 5
 * to 1. All other memory stays as it is. */
enum { REGION_0 = 0x10, REGION_1 = 0x11, READ_ONLY_4M = 6 << 24 | 21 << 1 | 1, NO_ACCESS_1K = 9 << 1 | 1 };
enum { PROTECT = 5 };

extern uint32_t data_image[], data_start[], data_end[], bss_start[], bss_end[]; /* of the linker script */

/* Handlers have a stack of their own, for the program's may be what has overflowed. */
static uint32_t handler_stack[HANDLER_STACK_WORDS];

static volatile uint32_t periods_left;

void watch_begin(uint32_t instructions) {
    periods_left = instructions / (SYSTICK_PERIOD / TICKS_NUMERATOR * TICKS_DENOMINATOR) + 1;
    SYSTICK_RELOAD = SYSTICK_PERIOD - 1;
    SYSTICK_VALUE = 0;
    SYSTICK_CONTROL = SYSTICK_ON;
}

void watch_end(void) { SYSTICK_CONTROL = 0; }

/* Where the program was interrupted: the seventh word of what the processor saved on the program's stack. */
static uint32_t interrupted_at(void) {
    const uint32_t *saved;
    __asm__("mrs %0, psp" : "=r"(saved));
    return saved >= stack_bottom && saved + 8 <= stack_top ? saved[6] : 0;
}

static void give_up(uint32_t message) {
    const uint32_t report[] = {message, CFSR, MMFAR, BFAR, interrupted_at()};
    host_write(report, sizeof report);
    host_exit();
}

static void fault(void) { give_up(MESSAGE_FAULT); }

static void tick(void) {
    if (--periods_left == 0) give_up(MESSAGE_ENDLESS);
}

/* Code and constants cannot be written, as in flash, and the first kilobyte, which holds the vectors alone, cannot even
 * be read: what a null pointer does comes out. */
static void protect(void) {
    MPU_BASE = REGION_0;
    MPU_SIZE = READ_ONLY_4M;
    MPU_BASE = REGION_1;
    MPU_SIZE = NO_ACCESS_1K;
    MPU_CONTROL = PROTECT;
    __asm__ volatile("dsb\n\tisb");
}

/* Apart from reset(), so that nothing of it can be computed before the coprocessor access is set. */
static __attribute__((noinline, noreturn)) void run(void) {
    const uint32_t *from = data_image;
    uint32_t *to;
    for (to = data_start; to < data_end;) *to++ = *from++;
    for (to = bss_start; to < bss_end;) *to++ = 0;
    protect();
    host_open();
    serve();
}

__attribute__((noreturn)) void reset(void) {
    CPACR |= FPU_FULL_ACCESS;
    __asm__ volatile("dsb\n\tisb\n\t"
                     "msr psp, %0\n\t"
                     "movs r0, #2\n\tmsr control, r0\n\tisb" /* from here on the program's stack */
                     :
                     : "r"(stack_top)
                     : "r0", "memory");
    run();
}

typedef void (*handler)(void);

__attribute__((section(".vectors"), used)) static const struct {
    const uint32_t *stack;
    handler handlers[15];
} vectors = {handler_stack + HANDLER_STACK_WORDS,
             {reset, fault, fault, fault, fault, fault, 0, 0, 0, 0, fault, fault, 0, fault, tick}};
