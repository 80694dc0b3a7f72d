/* The law of a stepper drive and its carriage for one axis and, side by side, for four: the same text, with other types
   (lanes.h). */
#pragma once
#include "../native/lanes.h"
#include "../native/records.h"

#define V double
#define M int64_t
#define OF(name) name
#define SEL sel_1
#define ANY any_1
#define NOT(mask) (!(mask))
#define ABS magnitude_1
#define BITS bits_1
#define LANES 1
#include "trigonometry.h"
#include "shaft.h"
#include "stepper.h"
#include "../plant/carriage.h"
#undef V
#undef M
#undef OF
#undef SEL
#undef ANY
#undef NOT
#undef ABS
#undef BITS
#undef LANES

#if WIDE
WIDE_BEGIN
#define V V4
#define M M4
#define OF(name) name##_4
#define SEL sel_4
#define ANY any_4
#define NOT(mask) (~(mask))
#define ABS magnitude_4
#define BITS bits_4
#define LANES 4
typedef struct {
#define FIELD_double(name) V4 name;
#define FIELD_int64_t(name) M4 name;
    AXIS_PARAMETERS_FIELDS
} AXIS_PARAMETERS_4;
typedef struct {
    AXIS_STATE_FIELDS
} AXIS_STATE_4;
typedef struct {
    AXIS_FIELDS
#undef FIELD_double
#undef FIELD_int64_t
} AXIS_4;
#include "trigonometry.h"
#include "shaft.h"
#include "stepper.h"
#include "../plant/carriage.h"
WIDE_END
#undef V
#undef M
#undef OF
#undef SEL
#undef ANY
#undef NOT
#undef ABS
#undef BITS
#undef LANES
#endif
