/* What a program in the emulator asks of the host: bytes in, bytes out, the end (Arm's semihosting interface). */
#ifndef SEMIHOSTING_H
#define SEMIHOSTING_H

#include <stddef.h>

/* Opens the emulator's own standard input and output; before everything else. */
void host_open(void);

/* Waits until all size bytes are there. Does not return when the host has closed its end. */
void host_read(void *bytes, size_t size);

void host_write(const void *bytes, size_t size);

/* Ends the emulator. */
void host_exit(void);

#endif
