/* What the parts of the firmware share, and how it talks.
 *
 * All words are 32 bits, least significant byte first; numbers are `real` as they lie in memory.
 *   at the start      -> HELLO, bytes of a real, outputs, inputs, rows of preview, disturbances, then two counts:
 *                        instructions found in a loop of CALIBRATION_INSTRUCTIONS, and CALIBRATION_INSTRUCTIONS
 *   RESET, u_before   -> RESET
 *   STEP, y, reference, w
 *                     -> STEP, instructions, bytes of stack, then of mpc_info: status, iterations, steps, clipped, held,
 *                        refused, worst_iterations, residual, worst_residual; u
 *   when it breaks    -> FAULT or ENDLESS, fault status register, addresses of memory and bus fault, of the instruction
 */
#ifndef FIRMWARE_H
#define FIRMWARE_H

#include <stdint.h>

enum message {
    MESSAGE_HELLO = 0x4C4C4548,
    MESSAGE_RESET = 0x45534552,
    MESSAGE_STEP = 0x50455453,
    MESSAGE_FAULT = 0x4C554146,
    MESSAGE_ENDLESS = 0x4C444E45
};

/* The board's timers tick every 40 ns, and with the emulator's -icount shift=7 an instruction takes 128 ns: 16 ticks
 * in 5 instructions, so that a difference of two readings, rounded, is an exact number of instructions. */
enum { TICKS_NUMERATOR = 16, TICKS_DENOMINATOR = 5 };

extern uint32_t stack_bottom[], stack_top[]; /* of the linker script */

/* Has the program ended, with a report, if watch_end does not come within about that many instructions. It interrupts
 * the program every 5 million instructions, which adds 6 to their number and a frame to the stack. */
void watch_begin(uint32_t instructions);
void watch_end(void);

__attribute__((noreturn)) void serve(void);

#endif
