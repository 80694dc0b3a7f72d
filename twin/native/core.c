/* The compiled core in one piece: all C of the twin, in the order of the signal chain. */
#include "core.h"
#include "exports.h"
#include "records.h"

#include "../capture/table.c"
#include "../capture/vcd.c"
#include "../plant/weighing.c"
#include "../recordings/vcd.c"
