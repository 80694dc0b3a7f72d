/* The compiled core in one piece: all C of the twin, in the order of the signal chain. */
#include "core.h"
#include "exports.h"
#include "records.h"

#include "cpu.c"
#include "../drives/curves.c"
#include "../drives/drives.c"
#include "../drives/stability.c"
#include "../plant/weighing.c"
#include "../plant/glide.c"
#include "../plant/touch.c"
#include "../plant/kernel.c"
#include "../../envs/tracking.c"
