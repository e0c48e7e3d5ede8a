#include "instance.h"

NAME instance;
