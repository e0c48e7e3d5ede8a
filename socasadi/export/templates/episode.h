/* A recorded episode: what was measured and wanted, and the tensions that Python computed from it. */
#ifndef EPISODE_H
#define EPISODE_H

#include "controller_data.h"

#define EPISODE_SAMPLES {{ samples }}
#define EPISODE_TOLERANCE {{ tolerance }} /* N */

static const double episode_held[CONTROLLER_INPUTS] = {{ held | c }};

static const double episode_output[EPISODE_SAMPLES][CONTROLLER_OUTPUTS] = {{ output | c }};

static const double episode_preview[EPISODE_SAMPLES][CONTROLLER_HORIZON * CONTROLLER_OUTPUTS] = {{ preview | c }};

static const double episode_tension[EPISODE_SAMPLES][CONTROLLER_INPUTS] = {{ tension | c }};

#endif
