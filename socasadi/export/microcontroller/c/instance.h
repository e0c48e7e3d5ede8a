/* The controller that is served. The build defines HEADER, its header, NAME and CAPITALS, its name in small letters
 * and in capitals. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include HEADER

#define PASTE(a, b) a##b
#define JOIN(a, b) PASTE(a, b)

#define OUTPUTS JOIN(CAPITALS, _OUTPUTS)
#define INPUTS JOIN(CAPITALS, _INPUTS)
#define PREVIEW JOIN(CAPITALS, _PREVIEW)
#define DISTURBANCES JOIN(CAPITALS, _DISTURBANCES)

/* In a file of its own, so that its memory is counted as the controller's. */
extern NAME instance;

#endif
