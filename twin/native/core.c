/* The compiled core in one piece: all C of the twin, in the order of the signal chain. */
#include "core.h"
#include "exports.h"
#include "records.h"

#include "../motion/circle.c"
#include "../motion/look_ahead.c"
#include "../motion/path.c"
#include "../motion/spreading.c"
#include "../motion/time_law.c"
#include "../firmware/gmi99/planner.c"
#include "../plant/following.c"
#include "../plant/weighing.c"
