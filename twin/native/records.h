/* Written by `python -m isel_twin.native.records` from the records and numbers in Python. */
#pragma once
#include <stddef.h>

#define SECOND_NS 1000000000
#define IS_TIME -2
#define NO_BIT 6
#define SHORT_ROW 7
#define TOO_LATE 8
#define NO_COUNT 9
#define ALL 63
#define LOST 64
#define FOUND 128
#define NO_TIME 1
#define EARLIER 2
#define NO_VALUE 3
#define NO_SIGNAL 4
#define NO_END 5
#define LONGEST_NS 1000000000000000000
#define SLOW_RAD_S 1.0
#define OPEN 0
#define PHASE_A 1
#define PHASE_B 2
#define BOTH 3
#define LAG_FAULT 1
#define VOLTAGE_FAULT 2
#define I2T_BACK 0.9
#define STEPPER 0
#define SERVO 1
#define STATES 6
#define STRAIGHT 1e-09
#define RIGHT_ANGLE_DEG 90.0
#define FARTHEST 2147483648.0
#define FRACTIONS 65536.0
#define SPEED_STEP_RAD_S 2.0
#define SPEEDS 256
#define AXES 3
#define SAMPLES 2048
#define FAR_M 1000.0
#define NEVER 9223372036854775807
#define KEPT 1
#define SAME 2
#define APART 0
#define FRESH 2
#define PARTED_MM 0.5
#define POSITION 0
#define LAG 1
#define TOUCH 3
#define BOX 0
#define RING 2
#define PLANE 3
#define NEWS 2
#define PULSE_NS 5000
#define SETUP_NS 1000
#define DONE 1
#define OUTSIDE 2
#define STEPS_LOST 4
#define IDLE -2
#define PREVIEW_MM {0.5, 1.0, 2.0, 4.0, 8.0}
#define SIZE 35

typedef struct {
    int64_t dof;
    double zero_m;
    double mobility_per_kg;
    double x_m;
    double v_m_s;
    double rest_m_s2;
    double friction_n;
    double held;
    double sum_n;
    double mean_n;
    double sum_nut_n;
    double mean_nut_n;
    double push_n;
    int64_t phases;
    double fraction;
    double idle_fraction;
    int64_t idle_delay;
    int64_t lowering;
    int64_t still_since;
    double steps_per_rad;
    double full_steps;
    double sum_nm;
    double mean_nm;
    double margin;
    double untaken;
    double turning_rad_s;
    double fastest_rad_s;
    int64_t fault;
    double command;
    double resistance_ohm;
    double inductance_h;
    double own_w;
    double supply_factor;
    double free_low_m;
    double free_high_m;
} AXIS;
_Static_assert(offsetof(AXIS, dof) == 0, "dof");
_Static_assert(offsetof(AXIS, zero_m) == 8, "zero_m");
_Static_assert(offsetof(AXIS, mobility_per_kg) == 16, "mobility_per_kg");
_Static_assert(offsetof(AXIS, x_m) == 24, "x_m");
_Static_assert(offsetof(AXIS, v_m_s) == 32, "v_m_s");
_Static_assert(offsetof(AXIS, rest_m_s2) == 40, "rest_m_s2");
_Static_assert(offsetof(AXIS, friction_n) == 48, "friction_n");
_Static_assert(offsetof(AXIS, held) == 56, "held");
_Static_assert(offsetof(AXIS, sum_n) == 64, "sum_n");
_Static_assert(offsetof(AXIS, mean_n) == 72, "mean_n");
_Static_assert(offsetof(AXIS, sum_nut_n) == 80, "sum_nut_n");
_Static_assert(offsetof(AXIS, mean_nut_n) == 88, "mean_nut_n");
_Static_assert(offsetof(AXIS, push_n) == 96, "push_n");
_Static_assert(offsetof(AXIS, phases) == 104, "phases");
_Static_assert(offsetof(AXIS, fraction) == 112, "fraction");
_Static_assert(offsetof(AXIS, idle_fraction) == 120, "idle_fraction");
_Static_assert(offsetof(AXIS, idle_delay) == 128, "idle_delay");
_Static_assert(offsetof(AXIS, lowering) == 136, "lowering");
_Static_assert(offsetof(AXIS, still_since) == 144, "still_since");
_Static_assert(offsetof(AXIS, steps_per_rad) == 152, "steps_per_rad");
_Static_assert(offsetof(AXIS, full_steps) == 160, "full_steps");
_Static_assert(offsetof(AXIS, sum_nm) == 168, "sum_nm");
_Static_assert(offsetof(AXIS, mean_nm) == 176, "mean_nm");
_Static_assert(offsetof(AXIS, margin) == 184, "margin");
_Static_assert(offsetof(AXIS, untaken) == 192, "untaken");
_Static_assert(offsetof(AXIS, turning_rad_s) == 200, "turning_rad_s");
_Static_assert(offsetof(AXIS, fastest_rad_s) == 208, "fastest_rad_s");
_Static_assert(offsetof(AXIS, fault) == 216, "fault");
_Static_assert(offsetof(AXIS, command) == 224, "command");
_Static_assert(offsetof(AXIS, resistance_ohm) == 232, "resistance_ohm");
_Static_assert(offsetof(AXIS, inductance_h) == 240, "inductance_h");
_Static_assert(offsetof(AXIS, own_w) == 248, "own_w");
_Static_assert(offsetof(AXIS, supply_factor) == 256, "supply_factor");
_Static_assert(offsetof(AXIS, free_low_m) == 264, "free_low_m");
_Static_assert(offsetof(AXIS, free_high_m) == 272, "free_high_m");

_Static_assert(sizeof(AXIS) == 280, "AXIS");

#define AXIS_FIELDS \
    FIELD_int64_t(dof) \
    FIELD_double(zero_m) \
    FIELD_double(mobility_per_kg) \
    FIELD_double(x_m) \
    FIELD_double(v_m_s) \
    FIELD_double(rest_m_s2) \
    FIELD_double(friction_n) \
    FIELD_double(held) \
    FIELD_double(sum_n) \
    FIELD_double(mean_n) \
    FIELD_double(sum_nut_n) \
    FIELD_double(mean_nut_n) \
    FIELD_double(push_n) \
    FIELD_int64_t(phases) \
    FIELD_double(fraction) \
    FIELD_double(idle_fraction) \
    FIELD_int64_t(idle_delay) \
    FIELD_int64_t(lowering) \
    FIELD_int64_t(still_since) \
    FIELD_double(steps_per_rad) \
    FIELD_double(full_steps) \
    FIELD_double(sum_nm) \
    FIELD_double(mean_nm) \
    FIELD_double(margin) \
    FIELD_double(untaken) \
    FIELD_double(turning_rad_s) \
    FIELD_double(fastest_rad_s) \
    FIELD_int64_t(fault) \
    FIELD_double(command) \
    FIELD_double(resistance_ohm) \
    FIELD_double(inductance_h) \
    FIELD_double(own_w) \
    FIELD_double(supply_factor) \
    FIELD_double(free_low_m) \
    FIELD_double(free_high_m)

TEXT layout_AXIS = "dof i8 0; zero_m f8 8; mobility_per_kg f8 16; x_m f8 24; v_m_s f8 32; rest_m_s2 f8 40; friction_n f8 48; held f8 56; sum_n f8 64; mean_n f8 72; sum_nut_n f8 80; mean_nut_n f8 88; push_n f8 96; phases i8 104; fraction f8 112; idle_fraction f8 120; idle_delay i8 128; lowering i8 136; still_since i8 144; steps_per_rad f8 152; full_steps f8 160; sum_nm f8 168; mean_nm f8 176; margin f8 184; untaken f8 192; turning_rad_s f8 200; fastest_rad_s f8 208; fault i8 216; command f8 224; resistance_ohm f8 232; inductance_h f8 240; own_w f8 248; supply_factor f8 256; free_low_m f8 264; free_high_m f8 272; 280";

typedef struct {
    int64_t kind;
    double microstep_rad;
    double phase_offset_rad;
    double stepped;
    double current_a;
    double drive_v;
    double return_v;
    double fast_share;
    double decay;
    double gain_a_per_v;
    double gain_v_per_a;
    double torque_constant_nm_per_a;
    double pole_pairs;
    double detent_torque_nm;
    double iron_nm_s_per_rad;
    double iron_knee_s_per_rad;
    double damping_gain;
    double smooth_share;
    double damping_share;
    double dt_s;
    double kick_rad_s_per_nm;
    double inertia_kgm2;
    double drag_nm_s_per_rad;
    double coulomb_nm;
    double stribeck_nm;
    double stribeck_rad_s;
    double travel_m_per_rad;
    double half_backlash_m;
    double stiffness_n_per_m;
    double damping_n_s_per_m;
    double forward_loss;
    double backward_loss;
    double plain;
    double step_error_rad;
    double current_offset;
    double increments_per_rad;
    int64_t loop_substeps;
    double position_gain_rad_s;
    double forward_rad_s;
    double speed_gain_a_s;
    double integral_share;
    double peak_a;
    double rated_a;
    double lag_limit;
    double window;
    int64_t window_substeps;
    double heat_share;
    int64_t connected;
} AXIS_PARAMETERS;
_Static_assert(offsetof(AXIS_PARAMETERS, kind) == 0, "kind");
_Static_assert(offsetof(AXIS_PARAMETERS, microstep_rad) == 8, "microstep_rad");
_Static_assert(offsetof(AXIS_PARAMETERS, phase_offset_rad) == 16, "phase_offset_rad");
_Static_assert(offsetof(AXIS_PARAMETERS, stepped) == 24, "stepped");
_Static_assert(offsetof(AXIS_PARAMETERS, current_a) == 32, "current_a");
_Static_assert(offsetof(AXIS_PARAMETERS, drive_v) == 40, "drive_v");
_Static_assert(offsetof(AXIS_PARAMETERS, return_v) == 48, "return_v");
_Static_assert(offsetof(AXIS_PARAMETERS, fast_share) == 56, "fast_share");
_Static_assert(offsetof(AXIS_PARAMETERS, decay) == 64, "decay");
_Static_assert(offsetof(AXIS_PARAMETERS, gain_a_per_v) == 72, "gain_a_per_v");
_Static_assert(offsetof(AXIS_PARAMETERS, gain_v_per_a) == 80, "gain_v_per_a");
_Static_assert(offsetof(AXIS_PARAMETERS, torque_constant_nm_per_a) == 88, "torque_constant_nm_per_a");
_Static_assert(offsetof(AXIS_PARAMETERS, pole_pairs) == 96, "pole_pairs");
_Static_assert(offsetof(AXIS_PARAMETERS, detent_torque_nm) == 104, "detent_torque_nm");
_Static_assert(offsetof(AXIS_PARAMETERS, iron_nm_s_per_rad) == 112, "iron_nm_s_per_rad");
_Static_assert(offsetof(AXIS_PARAMETERS, iron_knee_s_per_rad) == 120, "iron_knee_s_per_rad");
_Static_assert(offsetof(AXIS_PARAMETERS, damping_gain) == 128, "damping_gain");
_Static_assert(offsetof(AXIS_PARAMETERS, smooth_share) == 136, "smooth_share");
_Static_assert(offsetof(AXIS_PARAMETERS, damping_share) == 144, "damping_share");
_Static_assert(offsetof(AXIS_PARAMETERS, dt_s) == 152, "dt_s");
_Static_assert(offsetof(AXIS_PARAMETERS, kick_rad_s_per_nm) == 160, "kick_rad_s_per_nm");
_Static_assert(offsetof(AXIS_PARAMETERS, inertia_kgm2) == 168, "inertia_kgm2");
_Static_assert(offsetof(AXIS_PARAMETERS, drag_nm_s_per_rad) == 176, "drag_nm_s_per_rad");
_Static_assert(offsetof(AXIS_PARAMETERS, coulomb_nm) == 184, "coulomb_nm");
_Static_assert(offsetof(AXIS_PARAMETERS, stribeck_nm) == 192, "stribeck_nm");
_Static_assert(offsetof(AXIS_PARAMETERS, stribeck_rad_s) == 200, "stribeck_rad_s");
_Static_assert(offsetof(AXIS_PARAMETERS, travel_m_per_rad) == 208, "travel_m_per_rad");
_Static_assert(offsetof(AXIS_PARAMETERS, half_backlash_m) == 216, "half_backlash_m");
_Static_assert(offsetof(AXIS_PARAMETERS, stiffness_n_per_m) == 224, "stiffness_n_per_m");
_Static_assert(offsetof(AXIS_PARAMETERS, damping_n_s_per_m) == 232, "damping_n_s_per_m");
_Static_assert(offsetof(AXIS_PARAMETERS, forward_loss) == 240, "forward_loss");
_Static_assert(offsetof(AXIS_PARAMETERS, backward_loss) == 248, "backward_loss");
_Static_assert(offsetof(AXIS_PARAMETERS, plain) == 256, "plain");
_Static_assert(offsetof(AXIS_PARAMETERS, step_error_rad) == 264, "step_error_rad");
_Static_assert(offsetof(AXIS_PARAMETERS, current_offset) == 272, "current_offset");
_Static_assert(offsetof(AXIS_PARAMETERS, increments_per_rad) == 280, "increments_per_rad");
_Static_assert(offsetof(AXIS_PARAMETERS, loop_substeps) == 288, "loop_substeps");
_Static_assert(offsetof(AXIS_PARAMETERS, position_gain_rad_s) == 296, "position_gain_rad_s");
_Static_assert(offsetof(AXIS_PARAMETERS, forward_rad_s) == 304, "forward_rad_s");
_Static_assert(offsetof(AXIS_PARAMETERS, speed_gain_a_s) == 312, "speed_gain_a_s");
_Static_assert(offsetof(AXIS_PARAMETERS, integral_share) == 320, "integral_share");
_Static_assert(offsetof(AXIS_PARAMETERS, peak_a) == 328, "peak_a");
_Static_assert(offsetof(AXIS_PARAMETERS, rated_a) == 336, "rated_a");
_Static_assert(offsetof(AXIS_PARAMETERS, lag_limit) == 344, "lag_limit");
_Static_assert(offsetof(AXIS_PARAMETERS, window) == 352, "window");
_Static_assert(offsetof(AXIS_PARAMETERS, window_substeps) == 360, "window_substeps");
_Static_assert(offsetof(AXIS_PARAMETERS, heat_share) == 368, "heat_share");
_Static_assert(offsetof(AXIS_PARAMETERS, connected) == 376, "connected");

_Static_assert(sizeof(AXIS_PARAMETERS) == 384, "AXIS_PARAMETERS");

#define AXIS_PARAMETERS_FIELDS \
    FIELD_int64_t(kind) \
    FIELD_double(microstep_rad) \
    FIELD_double(phase_offset_rad) \
    FIELD_double(stepped) \
    FIELD_double(current_a) \
    FIELD_double(drive_v) \
    FIELD_double(return_v) \
    FIELD_double(fast_share) \
    FIELD_double(decay) \
    FIELD_double(gain_a_per_v) \
    FIELD_double(gain_v_per_a) \
    FIELD_double(torque_constant_nm_per_a) \
    FIELD_double(pole_pairs) \
    FIELD_double(detent_torque_nm) \
    FIELD_double(iron_nm_s_per_rad) \
    FIELD_double(iron_knee_s_per_rad) \
    FIELD_double(damping_gain) \
    FIELD_double(smooth_share) \
    FIELD_double(damping_share) \
    FIELD_double(dt_s) \
    FIELD_double(kick_rad_s_per_nm) \
    FIELD_double(inertia_kgm2) \
    FIELD_double(drag_nm_s_per_rad) \
    FIELD_double(coulomb_nm) \
    FIELD_double(stribeck_nm) \
    FIELD_double(stribeck_rad_s) \
    FIELD_double(travel_m_per_rad) \
    FIELD_double(half_backlash_m) \
    FIELD_double(stiffness_n_per_m) \
    FIELD_double(damping_n_s_per_m) \
    FIELD_double(forward_loss) \
    FIELD_double(backward_loss) \
    FIELD_double(plain) \
    FIELD_double(step_error_rad) \
    FIELD_double(current_offset) \
    FIELD_double(increments_per_rad) \
    FIELD_int64_t(loop_substeps) \
    FIELD_double(position_gain_rad_s) \
    FIELD_double(forward_rad_s) \
    FIELD_double(speed_gain_a_s) \
    FIELD_double(integral_share) \
    FIELD_double(peak_a) \
    FIELD_double(rated_a) \
    FIELD_double(lag_limit) \
    FIELD_double(window) \
    FIELD_int64_t(window_substeps) \
    FIELD_double(heat_share) \
    FIELD_int64_t(connected)

TEXT layout_AXIS_PARAMETERS = "kind i8 0; microstep_rad f8 8; phase_offset_rad f8 16; stepped f8 24; current_a f8 32; drive_v f8 40; return_v f8 48; fast_share f8 56; decay f8 64; gain_a_per_v f8 72; gain_v_per_a f8 80; torque_constant_nm_per_a f8 88; pole_pairs f8 96; detent_torque_nm f8 104; iron_nm_s_per_rad f8 112; iron_knee_s_per_rad f8 120; damping_gain f8 128; smooth_share f8 136; damping_share f8 144; dt_s f8 152; kick_rad_s_per_nm f8 160; inertia_kgm2 f8 168; drag_nm_s_per_rad f8 176; coulomb_nm f8 184; stribeck_nm f8 192; stribeck_rad_s f8 200; travel_m_per_rad f8 208; half_backlash_m f8 216; stiffness_n_per_m f8 224; damping_n_s_per_m f8 232; forward_loss f8 240; backward_loss f8 248; plain f8 256; step_error_rad f8 264; current_offset f8 272; increments_per_rad f8 280; loop_substeps i8 288; position_gain_rad_s f8 296; forward_rad_s f8 304; speed_gain_a_s f8 312; integral_share f8 320; peak_a f8 328; rated_a f8 336; lag_limit f8 344; window f8 352; window_substeps i8 360; heat_share f8 368; connected i8 376; 384";

typedef struct {
    double theta_rad;
    double omega_rad_s;
    double current_a_a;
    double current_b_a;
    double command;
    double shape_a;
    double shape_b;
    double smooth_rad;
    double lag_rad;
    double torque_nm;
    double force_n;
    int64_t at_rest;
    int64_t on;
    int64_t fault;
    int64_t cause;
    int64_t faults;
    int64_t due;
    double shift;
    double error;
    double wanted_a;
    double integral_rad_s;
    double sampled;
    double voltage_v;
    double heat;
    int64_t overloaded;
    int64_t arrived;
} AXIS_STATE;
_Static_assert(offsetof(AXIS_STATE, theta_rad) == 0, "theta_rad");
_Static_assert(offsetof(AXIS_STATE, omega_rad_s) == 8, "omega_rad_s");
_Static_assert(offsetof(AXIS_STATE, current_a_a) == 16, "current_a_a");
_Static_assert(offsetof(AXIS_STATE, current_b_a) == 24, "current_b_a");
_Static_assert(offsetof(AXIS_STATE, command) == 32, "command");
_Static_assert(offsetof(AXIS_STATE, shape_a) == 40, "shape_a");
_Static_assert(offsetof(AXIS_STATE, shape_b) == 48, "shape_b");
_Static_assert(offsetof(AXIS_STATE, smooth_rad) == 56, "smooth_rad");
_Static_assert(offsetof(AXIS_STATE, lag_rad) == 64, "lag_rad");
_Static_assert(offsetof(AXIS_STATE, torque_nm) == 72, "torque_nm");
_Static_assert(offsetof(AXIS_STATE, force_n) == 80, "force_n");
_Static_assert(offsetof(AXIS_STATE, at_rest) == 88, "at_rest");
_Static_assert(offsetof(AXIS_STATE, on) == 96, "on");
_Static_assert(offsetof(AXIS_STATE, fault) == 104, "fault");
_Static_assert(offsetof(AXIS_STATE, cause) == 112, "cause");
_Static_assert(offsetof(AXIS_STATE, faults) == 120, "faults");
_Static_assert(offsetof(AXIS_STATE, due) == 128, "due");
_Static_assert(offsetof(AXIS_STATE, shift) == 136, "shift");
_Static_assert(offsetof(AXIS_STATE, error) == 144, "error");
_Static_assert(offsetof(AXIS_STATE, wanted_a) == 152, "wanted_a");
_Static_assert(offsetof(AXIS_STATE, integral_rad_s) == 160, "integral_rad_s");
_Static_assert(offsetof(AXIS_STATE, sampled) == 168, "sampled");
_Static_assert(offsetof(AXIS_STATE, voltage_v) == 176, "voltage_v");
_Static_assert(offsetof(AXIS_STATE, heat) == 184, "heat");
_Static_assert(offsetof(AXIS_STATE, overloaded) == 192, "overloaded");
_Static_assert(offsetof(AXIS_STATE, arrived) == 200, "arrived");

_Static_assert(sizeof(AXIS_STATE) == 208, "AXIS_STATE");

#define AXIS_STATE_FIELDS \
    FIELD_double(theta_rad) \
    FIELD_double(omega_rad_s) \
    FIELD_double(current_a_a) \
    FIELD_double(current_b_a) \
    FIELD_double(command) \
    FIELD_double(shape_a) \
    FIELD_double(shape_b) \
    FIELD_double(smooth_rad) \
    FIELD_double(lag_rad) \
    FIELD_double(torque_nm) \
    FIELD_double(force_n) \
    FIELD_int64_t(at_rest) \
    FIELD_int64_t(on) \
    FIELD_int64_t(fault) \
    FIELD_int64_t(cause) \
    FIELD_int64_t(faults) \
    FIELD_int64_t(due) \
    FIELD_double(shift) \
    FIELD_double(error) \
    FIELD_double(wanted_a) \
    FIELD_double(integral_rad_s) \
    FIELD_double(sampled) \
    FIELD_double(voltage_v) \
    FIELD_double(heat) \
    FIELD_int64_t(overloaded) \
    FIELD_int64_t(arrived)

TEXT layout_AXIS_STATE = "theta_rad f8 0; omega_rad_s f8 8; current_a_a f8 16; current_b_a f8 24; command f8 32; shape_a f8 40; shape_b f8 48; smooth_rad f8 56; lag_rad f8 64; torque_nm f8 72; force_n f8 80; at_rest i8 88; on i8 96; fault i8 104; cause i8 112; faults i8 120; due i8 128; shift f8 136; error f8 144; wanted_a f8 152; integral_rad_s f8 160; sampled f8 168; voltage_v f8 176; heat f8 184; overloaded i8 192; arrived i8 200; 208";

typedef struct {
    int64_t on;
    int64_t flutes;
    int64_t start;
    double turns;
    double tooth_s;
    double gain;
    double most_m_s;
    double n_per_m;
    double m;
    double radial;
    double edge_n;
    double edge_radial_n;
    double enter_rad;
    double leave_rad;
    double left;
    double x_m_s;
    double y_m_s;
    double x_n;
    double y_n;
    double sum_x_n;
    double sum_y_n;
    double tool_m_per_n;
    double bend_m[2];
} CUT;
_Static_assert(offsetof(CUT, on) == 0, "on");
_Static_assert(offsetof(CUT, flutes) == 8, "flutes");
_Static_assert(offsetof(CUT, start) == 16, "start");
_Static_assert(offsetof(CUT, turns) == 24, "turns");
_Static_assert(offsetof(CUT, tooth_s) == 32, "tooth_s");
_Static_assert(offsetof(CUT, gain) == 40, "gain");
_Static_assert(offsetof(CUT, most_m_s) == 48, "most_m_s");
_Static_assert(offsetof(CUT, n_per_m) == 56, "n_per_m");
_Static_assert(offsetof(CUT, m) == 64, "m");
_Static_assert(offsetof(CUT, radial) == 72, "radial");
_Static_assert(offsetof(CUT, edge_n) == 80, "edge_n");
_Static_assert(offsetof(CUT, edge_radial_n) == 88, "edge_radial_n");
_Static_assert(offsetof(CUT, enter_rad) == 96, "enter_rad");
_Static_assert(offsetof(CUT, leave_rad) == 104, "leave_rad");
_Static_assert(offsetof(CUT, left) == 112, "left");
_Static_assert(offsetof(CUT, x_m_s) == 120, "x_m_s");
_Static_assert(offsetof(CUT, y_m_s) == 128, "y_m_s");
_Static_assert(offsetof(CUT, x_n) == 136, "x_n");
_Static_assert(offsetof(CUT, y_n) == 144, "y_n");
_Static_assert(offsetof(CUT, sum_x_n) == 152, "sum_x_n");
_Static_assert(offsetof(CUT, sum_y_n) == 160, "sum_y_n");
_Static_assert(offsetof(CUT, tool_m_per_n) == 168, "tool_m_per_n");
_Static_assert(offsetof(CUT, bend_m) == 176, "bend_m");

_Static_assert(sizeof(CUT) == 192, "CUT");

TEXT layout_CUT = "on i8 0; flutes i8 8; start i8 16; turns f8 24; tooth_s f8 32; gain f8 40; most_m_s f8 48; n_per_m f8 56; m f8 64; radial f8 72; edge_n f8 80; edge_radial_n f8 88; enter_rad f8 96; leave_rad f8 104; left f8 112; x_m_s f8 120; y_m_s f8 128; x_n f8 136; y_n f8 144; sum_x_n f8 152; sum_y_n f8 160; tool_m_per_n f8 168; bend_m ('<f8', (2,)) 176; 192";

typedef struct {
    int64_t on;
    int64_t broken;
    int64_t at;
    double radius_m;
    double below_m;
    double pretravel_m;
    double lobing_m;
    double over_m;
    double force_n;
    double force_z_n;
    double rate_n_per_m;
    double deflected_m;
    double push_n[3];
    double sum_n[3];
    double mean_n[3];
} FEELER;
_Static_assert(offsetof(FEELER, on) == 0, "on");
_Static_assert(offsetof(FEELER, broken) == 8, "broken");
_Static_assert(offsetof(FEELER, at) == 16, "at");
_Static_assert(offsetof(FEELER, radius_m) == 24, "radius_m");
_Static_assert(offsetof(FEELER, below_m) == 32, "below_m");
_Static_assert(offsetof(FEELER, pretravel_m) == 40, "pretravel_m");
_Static_assert(offsetof(FEELER, lobing_m) == 48, "lobing_m");
_Static_assert(offsetof(FEELER, over_m) == 56, "over_m");
_Static_assert(offsetof(FEELER, force_n) == 64, "force_n");
_Static_assert(offsetof(FEELER, force_z_n) == 72, "force_z_n");
_Static_assert(offsetof(FEELER, rate_n_per_m) == 80, "rate_n_per_m");
_Static_assert(offsetof(FEELER, deflected_m) == 88, "deflected_m");
_Static_assert(offsetof(FEELER, push_n) == 96, "push_n");
_Static_assert(offsetof(FEELER, sum_n) == 120, "sum_n");
_Static_assert(offsetof(FEELER, mean_n) == 144, "mean_n");

_Static_assert(sizeof(FEELER) == 168, "FEELER");

TEXT layout_FEELER = "on i8 0; broken i8 8; at i8 16; radius_m f8 24; below_m f8 32; pretravel_m f8 40; lobing_m f8 48; over_m f8 56; force_n f8 64; force_z_n f8 72; rate_n_per_m f8 80; deflected_m f8 88; push_n ('<f8', (3,)) 96; sum_n ('<f8', (3,)) 120; mean_n ('<f8', (3,)) 144; 168";

typedef struct {
    double ratio[6];
    int64_t influence[6];
    double speed_hz[7];
    double acceleration_hz_per_s[7];
    int64_t tool_speed;
    double jump_hz;
    double sharp_jump_hz;
} GMI99_RULES;
_Static_assert(offsetof(GMI99_RULES, ratio) == 0, "ratio");
_Static_assert(offsetof(GMI99_RULES, influence) == 48, "influence");
_Static_assert(offsetof(GMI99_RULES, speed_hz) == 96, "speed_hz");
_Static_assert(offsetof(GMI99_RULES, acceleration_hz_per_s) == 152, "acceleration_hz_per_s");
_Static_assert(offsetof(GMI99_RULES, tool_speed) == 208, "tool_speed");
_Static_assert(offsetof(GMI99_RULES, jump_hz) == 216, "jump_hz");
_Static_assert(offsetof(GMI99_RULES, sharp_jump_hz) == 224, "sharp_jump_hz");

_Static_assert(sizeof(GMI99_RULES) == 232, "GMI99_RULES");

TEXT layout_GMI99_RULES = "ratio ('<f8', (6,)) 0; influence ('<i8', (6,)) 48; speed_hz ('<f8', (7,)) 96; acceleration_hz_per_s ('<f8', (7,)) 152; tool_speed i8 208; jump_hz f8 216; sharp_jump_hz f8 224; 232";

typedef struct {
    double low_m;
    double high_m;
    double rest_n;
    double spring_n_per_m;
    double damper_n_s_per_m;
    double friction_n;
    double creep_per_s;
    double stuck_kg;
    double force_n;
} JOINT;
_Static_assert(offsetof(JOINT, low_m) == 0, "low_m");
_Static_assert(offsetof(JOINT, high_m) == 8, "high_m");
_Static_assert(offsetof(JOINT, rest_n) == 16, "rest_n");
_Static_assert(offsetof(JOINT, spring_n_per_m) == 24, "spring_n_per_m");
_Static_assert(offsetof(JOINT, damper_n_s_per_m) == 32, "damper_n_s_per_m");
_Static_assert(offsetof(JOINT, friction_n) == 40, "friction_n");
_Static_assert(offsetof(JOINT, creep_per_s) == 48, "creep_per_s");
_Static_assert(offsetof(JOINT, stuck_kg) == 56, "stuck_kg");
_Static_assert(offsetof(JOINT, force_n) == 64, "force_n");

_Static_assert(sizeof(JOINT) == 72, "JOINT");

TEXT layout_JOINT = "low_m f8 0; high_m f8 8; rest_n f8 16; spring_n_per_m f8 24; damper_n_s_per_m f8 32; friction_n f8 40; creep_per_s f8 48; stuck_kg f8 56; force_n f8 64; 72";

typedef struct {
    double highest_hz;
    double steps_per_mm;
    double half_slip;
    double limit_rad_s;
    double origin_mm;
    int64_t counter;
    double fraction;
    double rate_hz;
} LANE;
_Static_assert(offsetof(LANE, highest_hz) == 0, "highest_hz");
_Static_assert(offsetof(LANE, steps_per_mm) == 8, "steps_per_mm");
_Static_assert(offsetof(LANE, half_slip) == 16, "half_slip");
_Static_assert(offsetof(LANE, limit_rad_s) == 24, "limit_rad_s");
_Static_assert(offsetof(LANE, origin_mm) == 32, "origin_mm");
_Static_assert(offsetof(LANE, counter) == 40, "counter");
_Static_assert(offsetof(LANE, fraction) == 48, "fraction");
_Static_assert(offsetof(LANE, rate_hz) == 56, "rate_hz");

_Static_assert(sizeof(LANE) == 64, "LANE");

TEXT layout_LANE = "highest_hz f8 0; steps_per_mm f8 8; half_slip f8 16; limit_rad_s f8 24; origin_mm f8 32; counter i8 40; fraction f8 48; rate_hz f8 56; 64";

typedef struct {
    double pending;
    int64_t end_ns;
    int64_t lead_ns;
} LEAD;
_Static_assert(offsetof(LEAD, pending) == 0, "pending");
_Static_assert(offsetof(LEAD, end_ns) == 8, "end_ns");
_Static_assert(offsetof(LEAD, lead_ns) == 16, "lead_ns");

_Static_assert(sizeof(LEAD) == 24, "LEAD");

TEXT layout_LEAD = "pending f8 0; end_ns i8 8; lead_ns i8 16; 24";

typedef struct {
    int64_t first;
    int64_t last;
    int64_t t;
    int64_t rest;
    int64_t step;
    int64_t step_rest;
    int64_t den;
    int64_t rounded;
    int64_t sign;
    int64_t s;
    double s_rest;
    double f0;
    double two_a;
    double two_units;
    double t_rest;
} PHASE;
_Static_assert(offsetof(PHASE, first) == 0, "first");
_Static_assert(offsetof(PHASE, last) == 8, "last");
_Static_assert(offsetof(PHASE, t) == 16, "t");
_Static_assert(offsetof(PHASE, rest) == 24, "rest");
_Static_assert(offsetof(PHASE, step) == 32, "step");
_Static_assert(offsetof(PHASE, step_rest) == 40, "step_rest");
_Static_assert(offsetof(PHASE, den) == 48, "den");
_Static_assert(offsetof(PHASE, rounded) == 56, "rounded");
_Static_assert(offsetof(PHASE, sign) == 64, "sign");
_Static_assert(offsetof(PHASE, s) == 72, "s");
_Static_assert(offsetof(PHASE, s_rest) == 80, "s_rest");
_Static_assert(offsetof(PHASE, f0) == 88, "f0");
_Static_assert(offsetof(PHASE, two_a) == 96, "two_a");
_Static_assert(offsetof(PHASE, two_units) == 104, "two_units");
_Static_assert(offsetof(PHASE, t_rest) == 112, "t_rest");

_Static_assert(sizeof(PHASE) == 120, "PHASE");

TEXT layout_PHASE = "first i8 0; last i8 8; t i8 16; rest i8 24; step i8 32; step_rest i8 40; den i8 48; rounded i8 56; sign i8 64; s i8 72; s_rest f8 80; f0 f8 88; two_a f8 96; two_units f8 104; t_rest f8 112; 120";

typedef struct {
    int64_t substep_ns;
    int64_t window;
    int64_t usual;
    int64_t fine;
    int64_t calm;
    int64_t step_at;
    int64_t rest_windows;
    int64_t mj_step;
    int64_t model;
    int64_t data;
    int64_t now;
    int64_t quiet;
    int64_t settled;
    int64_t frozen;
    int64_t frozen_at;
    int64_t watched;
    int64_t edge;
    int64_t led_until_ns;
    int64_t lost_dof;
    int64_t uneven;
    int64_t sample_every;
    int64_t sample_at;
    int64_t sample_ahead_ns;
    int64_t sampled;
    int64_t look_every;
    int64_t look_at;
    int64_t look_ahead_ns;
    int64_t arrived;
    int64_t struck;
    int64_t held;
} PLANT;
_Static_assert(offsetof(PLANT, substep_ns) == 0, "substep_ns");
_Static_assert(offsetof(PLANT, window) == 8, "window");
_Static_assert(offsetof(PLANT, usual) == 16, "usual");
_Static_assert(offsetof(PLANT, fine) == 24, "fine");
_Static_assert(offsetof(PLANT, calm) == 32, "calm");
_Static_assert(offsetof(PLANT, step_at) == 40, "step_at");
_Static_assert(offsetof(PLANT, rest_windows) == 48, "rest_windows");
_Static_assert(offsetof(PLANT, mj_step) == 56, "mj_step");
_Static_assert(offsetof(PLANT, model) == 64, "model");
_Static_assert(offsetof(PLANT, data) == 72, "data");
_Static_assert(offsetof(PLANT, now) == 80, "now");
_Static_assert(offsetof(PLANT, quiet) == 88, "quiet");
_Static_assert(offsetof(PLANT, settled) == 96, "settled");
_Static_assert(offsetof(PLANT, frozen) == 104, "frozen");
_Static_assert(offsetof(PLANT, frozen_at) == 112, "frozen_at");
_Static_assert(offsetof(PLANT, watched) == 120, "watched");
_Static_assert(offsetof(PLANT, edge) == 128, "edge");
_Static_assert(offsetof(PLANT, led_until_ns) == 136, "led_until_ns");
_Static_assert(offsetof(PLANT, lost_dof) == 144, "lost_dof");
_Static_assert(offsetof(PLANT, uneven) == 152, "uneven");
_Static_assert(offsetof(PLANT, sample_every) == 160, "sample_every");
_Static_assert(offsetof(PLANT, sample_at) == 168, "sample_at");
_Static_assert(offsetof(PLANT, sample_ahead_ns) == 176, "sample_ahead_ns");
_Static_assert(offsetof(PLANT, sampled) == 184, "sampled");
_Static_assert(offsetof(PLANT, look_every) == 192, "look_every");
_Static_assert(offsetof(PLANT, look_at) == 200, "look_at");
_Static_assert(offsetof(PLANT, look_ahead_ns) == 208, "look_ahead_ns");
_Static_assert(offsetof(PLANT, arrived) == 216, "arrived");
_Static_assert(offsetof(PLANT, struck) == 224, "struck");
_Static_assert(offsetof(PLANT, held) == 232, "held");

_Static_assert(sizeof(PLANT) == 240, "PLANT");

TEXT layout_PLANT = "substep_ns i8 0; window i8 8; usual i8 16; fine i8 24; calm i8 32; step_at i8 40; rest_windows i8 48; mj_step i8 56; model i8 64; data i8 72; now i8 80; quiet i8 88; settled i8 96; frozen i8 104; frozen_at i8 112; watched i8 120; edge i8 128; led_until_ns i8 136; lost_dof i8 144; uneven i8 152; sample_every i8 160; sample_at i8 168; sample_ahead_ns i8 176; sampled i8 184; look_every i8 192; look_at i8 200; look_ahead_ns i8 208; arrived i8 216; struck i8 224; held i8 232; 240";

typedef struct {
    double t;
    double dt;
    double s0;
    double s1;
    double v0;
    double v1;
} PLAN_PHASE;
_Static_assert(offsetof(PLAN_PHASE, t) == 0, "t");
_Static_assert(offsetof(PLAN_PHASE, dt) == 8, "dt");
_Static_assert(offsetof(PLAN_PHASE, s0) == 16, "s0");
_Static_assert(offsetof(PLAN_PHASE, s1) == 24, "s1");
_Static_assert(offsetof(PLAN_PHASE, v0) == 32, "v0");
_Static_assert(offsetof(PLAN_PHASE, v1) == 40, "v1");

_Static_assert(sizeof(PLAN_PHASE) == 48, "PLAN_PHASE");

TEXT layout_PLAN_PHASE = "t f8 0; dt f8 8; s0 f8 16; s1 f8 24; v0 f8 32; v1 f8 40; 48";

typedef struct {
    double length;
    double speed;
    double limit;
    double acceleration;
    double entry;
} PLAN_PIECE;
_Static_assert(offsetof(PLAN_PIECE, length) == 0, "length");
_Static_assert(offsetof(PLAN_PIECE, speed) == 8, "speed");
_Static_assert(offsetof(PLAN_PIECE, limit) == 16, "limit");
_Static_assert(offsetof(PLAN_PIECE, acceleration) == 24, "acceleration");
_Static_assert(offsetof(PLAN_PIECE, entry) == 32, "entry");

_Static_assert(sizeof(PLAN_PIECE) == 40, "PLAN_PIECE");

TEXT layout_PLAN_PIECE = "length f8 0; speed f8 8; limit f8 16; acceleration f8 24; entry f8 32; 40";

typedef struct {
    int64_t place;
    int64_t line;
    int64_t time;
    int64_t begin;
    int64_t problem;
    int64_t column;
    int64_t rows;
    int64_t part;
} SCAN;
_Static_assert(offsetof(SCAN, place) == 0, "place");
_Static_assert(offsetof(SCAN, line) == 8, "line");
_Static_assert(offsetof(SCAN, time) == 16, "time");
_Static_assert(offsetof(SCAN, begin) == 24, "begin");
_Static_assert(offsetof(SCAN, problem) == 32, "problem");
_Static_assert(offsetof(SCAN, column) == 40, "column");
_Static_assert(offsetof(SCAN, rows) == 48, "rows");
_Static_assert(offsetof(SCAN, part) == 56, "part");

_Static_assert(sizeof(SCAN) == 64, "SCAN");

TEXT layout_SCAN = "place i8 0; line i8 8; time i8 16; begin i8 24; problem i8 32; column i8 40; rows i8 48; part i8 56; 64";

typedef struct {
    double start_m;
    double travel_m_per_rad;
    double cyclic_m;
    double soft_m_per_n;
    double free_m;
    double rod_n;
} SCREW;
_Static_assert(offsetof(SCREW, start_m) == 0, "start_m");
_Static_assert(offsetof(SCREW, travel_m_per_rad) == 8, "travel_m_per_rad");
_Static_assert(offsetof(SCREW, cyclic_m) == 16, "cyclic_m");
_Static_assert(offsetof(SCREW, soft_m_per_n) == 24, "soft_m_per_n");
_Static_assert(offsetof(SCREW, free_m) == 32, "free_m");
_Static_assert(offsetof(SCREW, rod_n) == 40, "rod_n");

_Static_assert(sizeof(SCREW) == 48, "SCREW");

TEXT layout_SCREW = "start_m f8 0; travel_m_per_rad f8 8; cyclic_m f8 16; soft_m_per_n f8 24; free_m f8 32; rod_n f8 40; 48";

typedef struct {
    int64_t on;
    int64_t gate;
    int64_t steady;
    double voltage_v;
    double source_v;
    double source_ohm;
    double charge_decay;
    double window_s;
    double capacitance_f;
    double chopper_v;
    double chopper_ohm;
    double undervoltage_v;
    double release_v;
    double energy_j;
    double mean_j;
    double magnetic_j;
    double drawn_j;
    double dumped_j;
} SUPPLY;
_Static_assert(offsetof(SUPPLY, on) == 0, "on");
_Static_assert(offsetof(SUPPLY, gate) == 8, "gate");
_Static_assert(offsetof(SUPPLY, steady) == 16, "steady");
_Static_assert(offsetof(SUPPLY, voltage_v) == 24, "voltage_v");
_Static_assert(offsetof(SUPPLY, source_v) == 32, "source_v");
_Static_assert(offsetof(SUPPLY, source_ohm) == 40, "source_ohm");
_Static_assert(offsetof(SUPPLY, charge_decay) == 48, "charge_decay");
_Static_assert(offsetof(SUPPLY, window_s) == 56, "window_s");
_Static_assert(offsetof(SUPPLY, capacitance_f) == 64, "capacitance_f");
_Static_assert(offsetof(SUPPLY, chopper_v) == 72, "chopper_v");
_Static_assert(offsetof(SUPPLY, chopper_ohm) == 80, "chopper_ohm");
_Static_assert(offsetof(SUPPLY, undervoltage_v) == 88, "undervoltage_v");
_Static_assert(offsetof(SUPPLY, release_v) == 96, "release_v");
_Static_assert(offsetof(SUPPLY, energy_j) == 104, "energy_j");
_Static_assert(offsetof(SUPPLY, mean_j) == 112, "mean_j");
_Static_assert(offsetof(SUPPLY, magnetic_j) == 120, "magnetic_j");
_Static_assert(offsetof(SUPPLY, drawn_j) == 128, "drawn_j");
_Static_assert(offsetof(SUPPLY, dumped_j) == 136, "dumped_j");

_Static_assert(sizeof(SUPPLY) == 144, "SUPPLY");

TEXT layout_SUPPLY = "on i8 0; gate i8 8; steady i8 16; voltage_v f8 24; source_v f8 32; source_ohm f8 40; charge_decay f8 48; window_s f8 56; capacitance_f f8 64; chopper_v f8 72; chopper_ohm f8 80; undervoltage_v f8 88; release_v f8 96; energy_j f8 104; mean_j f8 112; magnetic_j f8 120; drawn_j f8 128; dumped_j f8 136; 144";

typedef struct {
    int64_t axis;
    int64_t sense;
    double strike;
    double release;
    int64_t struck;
} SWITCH;
_Static_assert(offsetof(SWITCH, axis) == 0, "axis");
_Static_assert(offsetof(SWITCH, sense) == 8, "sense");
_Static_assert(offsetof(SWITCH, strike) == 16, "strike");
_Static_assert(offsetof(SWITCH, release) == 24, "release");
_Static_assert(offsetof(SWITCH, struck) == 32, "struck");

_Static_assert(sizeof(SWITCH) == 40, "SWITCH");

TEXT layout_SWITCH = "axis i8 0; sense i8 8; strike f8 16; release f8 24; struck i8 32; 40";

typedef struct {
    int64_t kind;
    double x_m;
    double y_m;
    double z_m;
    double a_m;
    double b_m;
    double c_m;
    double cosine;
    double sine;
} TARGET;
_Static_assert(offsetof(TARGET, kind) == 0, "kind");
_Static_assert(offsetof(TARGET, x_m) == 8, "x_m");
_Static_assert(offsetof(TARGET, y_m) == 16, "y_m");
_Static_assert(offsetof(TARGET, z_m) == 24, "z_m");
_Static_assert(offsetof(TARGET, a_m) == 32, "a_m");
_Static_assert(offsetof(TARGET, b_m) == 40, "b_m");
_Static_assert(offsetof(TARGET, c_m) == 48, "c_m");
_Static_assert(offsetof(TARGET, cosine) == 56, "cosine");
_Static_assert(offsetof(TARGET, sine) == 64, "sine");

_Static_assert(sizeof(TARGET) == 72, "TARGET");

TEXT layout_TARGET = "kind i8 0; x_m f8 8; y_m f8 16; z_m f8 24; a_m f8 32; b_m f8 40; c_m f8 48; cosine f8 56; sine f8 64; 72";

typedef struct {
    int64_t quantity;
    int64_t axis;
    double sense;
    double limit;
    double hysteresis;
    int64_t passed;
} THRESHOLD;
_Static_assert(offsetof(THRESHOLD, quantity) == 0, "quantity");
_Static_assert(offsetof(THRESHOLD, axis) == 8, "axis");
_Static_assert(offsetof(THRESHOLD, sense) == 16, "sense");
_Static_assert(offsetof(THRESHOLD, limit) == 24, "limit");
_Static_assert(offsetof(THRESHOLD, hysteresis) == 32, "hysteresis");
_Static_assert(offsetof(THRESHOLD, passed) == 40, "passed");

_Static_assert(sizeof(THRESHOLD) == 48, "THRESHOLD");

TEXT layout_THRESHOLD = "quantity i8 0; axis i8 8; sense f8 16; limit f8 24; hysteresis f8 32; passed i8 40; 48";

typedef struct {
    int64_t step_ns;
    double tolerance_mm;
    double reach_mm;
    double time_limit_s;
    double time_weight;
    double deviation_weight;
    double abort_penalty;
    int64_t until_ns;
    int64_t began_ns;
    int64_t piece;
    double way_mm;
    double tool_mm[3];
    int64_t rest_ns;
    double led_mm;
    double deviation_mm;
    double edge;
    double reward_progress;
    double reward_time;
    double reward_deviation;
    double reward_abort;
} TRACK;
_Static_assert(offsetof(TRACK, step_ns) == 0, "step_ns");
_Static_assert(offsetof(TRACK, tolerance_mm) == 8, "tolerance_mm");
_Static_assert(offsetof(TRACK, reach_mm) == 16, "reach_mm");
_Static_assert(offsetof(TRACK, time_limit_s) == 24, "time_limit_s");
_Static_assert(offsetof(TRACK, time_weight) == 32, "time_weight");
_Static_assert(offsetof(TRACK, deviation_weight) == 40, "deviation_weight");
_Static_assert(offsetof(TRACK, abort_penalty) == 48, "abort_penalty");
_Static_assert(offsetof(TRACK, until_ns) == 56, "until_ns");
_Static_assert(offsetof(TRACK, began_ns) == 64, "began_ns");
_Static_assert(offsetof(TRACK, piece) == 72, "piece");
_Static_assert(offsetof(TRACK, way_mm) == 80, "way_mm");
_Static_assert(offsetof(TRACK, tool_mm) == 88, "tool_mm");
_Static_assert(offsetof(TRACK, rest_ns) == 112, "rest_ns");
_Static_assert(offsetof(TRACK, led_mm) == 120, "led_mm");
_Static_assert(offsetof(TRACK, deviation_mm) == 128, "deviation_mm");
_Static_assert(offsetof(TRACK, edge) == 136, "edge");
_Static_assert(offsetof(TRACK, reward_progress) == 144, "reward_progress");
_Static_assert(offsetof(TRACK, reward_time) == 152, "reward_time");
_Static_assert(offsetof(TRACK, reward_deviation) == 160, "reward_deviation");
_Static_assert(offsetof(TRACK, reward_abort) == 168, "reward_abort");

_Static_assert(sizeof(TRACK) == 176, "TRACK");

TEXT layout_TRACK = "step_ns i8 0; tolerance_mm f8 8; reach_mm f8 16; time_limit_s f8 24; time_weight f8 32; deviation_weight f8 40; abort_penalty f8 48; until_ns i8 56; began_ns i8 64; piece i8 72; way_mm f8 80; tool_mm ('<f8', (3,)) 88; rest_ns i8 112; led_mm f8 120; deviation_mm f8 128; edge f8 136; reward_progress f8 144; reward_time f8 152; reward_deviation f8 160; reward_abort f8 168; 176";

typedef struct {
    PLANT *plant;
    AXIS *axes;
    AXIS_PARAMETERS *drives;
    SCREW *screws;
    AXIS_STATE *states;
    THRESHOLD *thresholds;
    int64_t *commanded;
    LEAD *leads;
    double *available;
    JOINT *joints_law;
    double *mobility;
    double *push;
    double *springs;
    CUT *cut;
    double *tip_nuts;
    double *tip_joints;
    FEELER *feeler;
    TARGET *targets;
    double *shape;
    SUPPLY *supply;
    double *before;
    double *rates;
    int64_t *touching;
    double *touched_m;
    double *found;
    double *samples;
    int64_t *kept;
    double *place;
    double *qpos;
    double *qvel;
    double *qacc;
    double *qacc_smooth;
    double *qfrc;
    int64_t joints;
    int64_t number_of_thresholds;
    int64_t commands;
    int64_t speeds;
    int64_t fields;
    int64_t pairs;
    int64_t number_of_targets;
    int64_t words;
} MEMORY;
_Static_assert(offsetof(MEMORY, plant) == 0, "plant");
_Static_assert(offsetof(MEMORY, axes) == 8, "axes");
_Static_assert(offsetof(MEMORY, drives) == 16, "drives");
_Static_assert(offsetof(MEMORY, screws) == 24, "screws");
_Static_assert(offsetof(MEMORY, states) == 32, "states");
_Static_assert(offsetof(MEMORY, thresholds) == 40, "thresholds");
_Static_assert(offsetof(MEMORY, commanded) == 48, "commanded");
_Static_assert(offsetof(MEMORY, leads) == 56, "leads");
_Static_assert(offsetof(MEMORY, available) == 64, "available");
_Static_assert(offsetof(MEMORY, joints_law) == 72, "joints_law");
_Static_assert(offsetof(MEMORY, mobility) == 80, "mobility");
_Static_assert(offsetof(MEMORY, push) == 88, "push");
_Static_assert(offsetof(MEMORY, springs) == 96, "springs");
_Static_assert(offsetof(MEMORY, cut) == 104, "cut");
_Static_assert(offsetof(MEMORY, tip_nuts) == 112, "tip_nuts");
_Static_assert(offsetof(MEMORY, tip_joints) == 120, "tip_joints");
_Static_assert(offsetof(MEMORY, feeler) == 128, "feeler");
_Static_assert(offsetof(MEMORY, targets) == 136, "targets");
_Static_assert(offsetof(MEMORY, shape) == 144, "shape");
_Static_assert(offsetof(MEMORY, supply) == 152, "supply");
_Static_assert(offsetof(MEMORY, before) == 160, "before");
_Static_assert(offsetof(MEMORY, rates) == 168, "rates");
_Static_assert(offsetof(MEMORY, touching) == 176, "touching");
_Static_assert(offsetof(MEMORY, touched_m) == 184, "touched_m");
_Static_assert(offsetof(MEMORY, found) == 192, "found");
_Static_assert(offsetof(MEMORY, samples) == 200, "samples");
_Static_assert(offsetof(MEMORY, kept) == 208, "kept");
_Static_assert(offsetof(MEMORY, place) == 216, "place");
_Static_assert(offsetof(MEMORY, qpos) == 224, "qpos");
_Static_assert(offsetof(MEMORY, qvel) == 232, "qvel");
_Static_assert(offsetof(MEMORY, qacc) == 240, "qacc");
_Static_assert(offsetof(MEMORY, qacc_smooth) == 248, "qacc_smooth");
_Static_assert(offsetof(MEMORY, qfrc) == 256, "qfrc");
_Static_assert(offsetof(MEMORY, joints) == 264, "joints");
_Static_assert(offsetof(MEMORY, number_of_thresholds) == 272, "number_of_thresholds");
_Static_assert(offsetof(MEMORY, commands) == 280, "commands");
_Static_assert(offsetof(MEMORY, speeds) == 288, "speeds");
_Static_assert(offsetof(MEMORY, fields) == 296, "fields");
_Static_assert(offsetof(MEMORY, pairs) == 304, "pairs");
_Static_assert(offsetof(MEMORY, number_of_targets) == 312, "number_of_targets");
_Static_assert(offsetof(MEMORY, words) == 320, "words");

_Static_assert(sizeof(MEMORY) == 328, "MEMORY");

TEXT layout_MEMORY = "plant i8 0; axes i8 8; drives i8 16; screws i8 24; states i8 32; thresholds i8 40; commanded i8 48; leads i8 56; available i8 64; joints_law i8 72; mobility i8 80; push i8 88; springs i8 96; cut i8 104; tip_nuts i8 112; tip_joints i8 120; feeler i8 128; targets i8 136; shape i8 144; supply i8 152; before i8 160; rates i8 168; touching i8 176; touched_m i8 184; found i8 192; samples i8 200; kept i8 208; place i8 216; qpos i8 224; qvel i8 232; qacc i8 240; qacc_smooth i8 248; qfrc i8 256; joints i8 264; number_of_thresholds i8 272; commands i8 280; speeds i8 288; fields i8 296; pairs i8 304; number_of_targets i8 312; words i8 320; 328";

typedef struct {
    MEMORY *memory;
    TRACK *track;
    LANE *lanes;
    double *shape_mm;
    double *path;
    int64_t *t_ns;
    int32_t *delta;
    int64_t joints;
    int64_t points;
    int64_t pulses;
} PLACE;
_Static_assert(offsetof(PLACE, memory) == 0, "memory");
_Static_assert(offsetof(PLACE, track) == 8, "track");
_Static_assert(offsetof(PLACE, lanes) == 16, "lanes");
_Static_assert(offsetof(PLACE, shape_mm) == 24, "shape_mm");
_Static_assert(offsetof(PLACE, path) == 32, "path");
_Static_assert(offsetof(PLACE, t_ns) == 40, "t_ns");
_Static_assert(offsetof(PLACE, delta) == 48, "delta");
_Static_assert(offsetof(PLACE, joints) == 56, "joints");
_Static_assert(offsetof(PLACE, points) == 64, "points");
_Static_assert(offsetof(PLACE, pulses) == 72, "pulses");

_Static_assert(sizeof(PLACE) == 80, "PLACE");

TEXT layout_PLACE = "memory i8 0; track i8 8; lanes i8 16; shape_mm i8 24; path i8 32; t_ns i8 40; delta i8 48; joints i8 56; points i8 64; pulses i8 72; 80";
