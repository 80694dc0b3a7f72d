"""The compiled loop: three drives and MuJoCo together, up to the first threshold passed.

It advances the whole plant at little more than the cost of MuJoCo alone, and the result is the same to the bit however
time is cut into calls. Time is counted in sub-steps of dt from power-on; every n sub-steps, a window, MuJoCo makes one
step:

      window: one MuJoCo step                       sub-step: F_j = drive(command, x_j, v_j)
    |--+--+--+--+--+--+--+--|                       v_j+1 = v_j + dt (F_j / m + a), less the friction's dt F_f / m
       F_1 F_2 ...      F_n   -> mean F on the nut  x_j+1 = x_j + dt (v_j + v_j+1) / 2
                              -> mj_step            window start: v from MuJoCo, a from its last step

Inside the window the drives see a carriage that responds to nut force and guide friction (m: inertia at the nut). Other
forces are those of the window before, except springs and dampers of the structure, which are those at the start of this
one: a window late they would feed oscillations. At the end MuJoCo, with friction, stops, structure and contacts, gives
the velocity, and the position is corrected by the difference:

    x = x_n + h (v_MuJoCo - v_n)                    h = n dt

which is MuJoCo's own rule (x' = x + h v') for the forces that only MuJoCo has, and the sub-steps' for the nut force and
the moment at which friction stops a carriage: both are resolved at dt, not at h (plant/3). MuJoCo's dry friction creeps
(below 1 um/s); a carriage that sticks in the sub-steps does not. Thresholds are compared after every sub-step.

A drive gets the exact time mean of its command over the sub-step: the sum of the ticks, each weighted by the part of
the sub-step that follows it, less the mean of the rest of the leads (lead.py).

Shaken: a motor that has lost its step throws its nut to and fro, at a stop above all. Where the structure moves faster
than SHAKEN_M_S, as no motion in step does, windows are cut into `fine` ones until it has been calm (plant/25): the
exchange could not follow else, and would feed what it should damp.

Rest: after `rest_windows` windows of standstill without leads the plant is frozen: all sub-steps up to the next tick or
change of current are skipped (plant/6). Of these windows themselves those are skipped that would change no bit.

MuJoCo's step is called by its address (native.py). Between the stops, without contact, it is written out instead
(glide.py).
"""

import math

import numpy as np

from isel_twin.base.compiling import contains, njit
from isel_twin.drives import dynamics, servo, servo_drive, trigonometry
from isel_twin.drives.dynamics import OPEN, stepper_torque
from isel_twin.drives.servo import cool, servo_torque
from isel_twin.drives.shaft import AXIS_STATE, SERVO, at_rest, turn
from isel_twin.plant import feed, glide, margin, memory, native, teeth, thread, touch
from isel_twin.plant.lead import begin, behind, mean_behind
from isel_twin.plant.memory import APART, AXES, FRESH, KEPT, LAG, PARTED_MM, POSITION, SAME, TOUCH, array_at, parts_of
from isel_twin.plant.native import call_mj_step

REST_M_S = 5e-6  # speed below which a joint counts as at rest
HELD_M_S2 = 1e-3  # constraint acceleration beyond friction that counts as a carriage held; rounding is far below
LEAST_BEND_M = 1e-9  # of a tool, below which the machine may rest
SHAKEN_M_S = 0.25  # speed of a joint of the structure beyond which windows become fine
CALM = 40  # fine windows without it, after which they are as usual again
FAR_M = 1e3  # a joint beyond this has run away
NEVER = np.iinfo(np.int64).max
AXIS_WORDS, STATE_WORDS = AXES * memory.AXIS.itemsize // 8, AXES * AXIS_STATE.itemsize // 8  # in `kept`; joints follow


@njit(inner=True, nogil=True, error_model="numpy")
def _lower_at(axis):
    """Sub-step in which the current of an axis is lowered (plant/7); NEVER if not asked for or done."""
    if axis.lowering == 0 or axis.phases == OPEN or axis.fraction == axis.idle_fraction:
        return NEVER
    return axis.still_since + axis.idle_delay


@njit(inner=True, nogil=True, error_model="numpy")
def _wake(plant, axes, drives, states, supply, feeler):
    """Leave the frozen state; the elapsed part of the window gets the force that held the carriage."""
    plant.settled = 0
    if plant.frozen == 0:
        return
    plant.frozen = 0
    plant.held = 0
    plant.quiet = 0
    over = plant.now % plant.window
    for i in range(AXES):
        if drives[i].kind == SERVO:
            loop = drives[i].loop_substeps
            states[i].heat = cool(drives[i], states[i], plant.now - plant.frozen_at)
            states[i].due = (loop - plant.now % loop) % loop + 1
    for i in range(AXES):
        axes[i].sum_n = axes[i].mean_n * over
        axes[i].sum_nut_n = axes[i].mean_nut_n * over
        axes[i].sum_nm = axes[i].mean_nm * over
    supply.energy_j = supply.mean_j * over / plant.window
    for i in range(AXES):
        feeler.sum_n[i] = feeler.mean_n[i] * over


@njit(nogil=True, error_model="numpy")
def wake(memory):
    """Leave the frozen state, before a change from outside."""
    parts = parts_of(memory)
    _wake(parts.plant[0], parts.axes, parts.drives, parts.states, parts.supply[0], parts.feeler[0])


@njit(nogil=True, error_model="numpy")
def begin_window(memory):
    """Take the carriages from MuJoCo at the start of a window.

    Constraint forces up to the guide friction are friction; more than that is a stop or a collision: the carriage
    cannot go on that way, however the nut pushes.
    """
    parts = parts_of(memory)
    qacc_smooth = parts.qacc_smooth
    for i in range(AXES):
        axis = parts.axes[i]
        axis.x_m = parts.qpos[axis.dof]
        axis.v_m_s = parts.qvel[axis.dof]
        push_m_s2 = parts.qacc[axis.dof] - qacc_smooth[axis.dof]
        free = abs(push_m_s2) <= axis.mobility_per_kg * axis.friction_n + HELD_M_S2
        axis.held = 0.0 if free else math.copysign(1.0, push_m_s2)
        axis.rest_m_s2 = qacc_smooth[axis.dof] - axis.mobility_per_kg * axis.mean_n
        axis.sum_n = 0.0
        axis.sum_nut_n = 0.0


@njit(inner=True, nogil=True, error_model="numpy")
def _feel(plant, axes, touching, touched_m, found):
    """Which pairs touch, after a step of MuJoCo; one that begins to is news."""
    for k in range(touching.shape[0]):
        if found[k] > 0.0:
            if touching[k] == APART:
                touching[k] = FRESH
                plant.struck = 1
            for i in range(AXES):
                touched_m[k, i] = axes[i].x_m
        elif touching[k] != APART:
            for i in range(AXES):
                if abs(axes[i].x_m - touched_m[k, i]) > 1e-3 * PARTED_MM:
                    touching[k] = APART


@njit(inner=True, nogil=True, error_model="numpy")
def _leave_window(memory):
    """One MuJoCo step with the mean forces of the window; freezes the plant after a long enough standstill."""
    parts = parts_of(memory)
    plant, axes, cut = parts.plant[0], parts.axes, parts.cut[0]
    qpos, qvel, qfrc, before, rates = parts.qpos, parts.qvel, parts.qfrc, parts.before, parts.rates
    push, springs, tip_joints, feeler = parts.push, parts.springs, parts.tip_joints, parts.feeler[0]
    quiet, by_mujoco = plant.led_until_ns <= plant.now * plant.substep_ns and parts.supply[0].steady != 0, False
    for j in range(qfrc.shape[0]):
        qfrc[j] = push[0, j] + push[1, j] / plant.window
        push[1, j] = 0.0
    if cut.sum_x_n != 0.0 or cut.sum_y_n != 0.0:
        quiet = False
        for j in range(qfrc.shape[0]):
            qfrc[j] += (tip_joints[0, j] * cut.sum_x_n + tip_joints[1, j] * cut.sum_y_n) / plant.window
        cut.sum_x_n = 0.0
        cut.sum_y_n = 0.0
    if cut.on and max(abs(cut.bend_m[0]), abs(cut.bend_m[1])) > LEAST_BEND_M:
        quiet = False
    if feeler.on:
        for i in range(AXES):
            feeler.mean_n[i] = feeler.sum_n[i] / plant.window
            feeler.sum_n[i] = 0.0
            for j in range(qfrc.shape[0]):
                qfrc[j] += tip_joints[i, j] * feeler.mean_n[i]
    for i in range(AXES):
        axis = axes[i]
        axis.mean_n = axis.sum_n / plant.window
        axis.mean_nut_n = axis.sum_nut_n / plant.window
        qfrc[axis.dof] += axis.mean_n
        quiet = quiet and at_rest(parts.states[i])
        if not (math.isfinite(axis.mean_n) and abs(axis.x_m) < FAR_M):
            plant.lost_dof = axis.dof
            return
    for j in range(qpos.shape[0]):  # element by element: compiles in a fraction of the time of a slice
        before[j] = qpos[j]
        rates[j] = qvel[j]
    window_s = 1e-9 * plant.substep_ns * plant.window
    if not glide.glide(parts.joints_law, parts.mobility, window_s, qpos, qvel, parts.qacc, parts.qacc_smooth, qfrc):
        by_mujoco = True
        if plant.window == plant.usual:
            call_mj_step(plant.mj_step, plant.model, plant.data)
        else:
            step_s = array_at(plant.step_at, (1,), np.float64)
            usual_s = step_s[0]
            step_s[0] = window_s
            call_mj_step(plant.mj_step, plant.model, plant.data)
            step_s[0] = usual_s
        _feel(plant, axes, parts.touching, parts.touched_m, parts.found)
    for i in range(AXES):
        axis = axes[i]
        if axis.v_m_s == 0.0 and abs(qvel[axis.dof]) < REST_M_S:
            qvel[axis.dof] = 0.0
        qpos[axis.dof] = axis.x_m + window_s * (qvel[axis.dof] - axis.v_m_s)
    for j in range(qvel.shape[0]):
        if plant.lost_dof < 0 and not abs(qpos[j]) < FAR_M:
            plant.lost_dof = j
        quiet = quiet and abs(qvel[j]) < REST_M_S
    _pace(plant, axes, parts.supply[0], qvel)
    plant.quiet = plant.quiet + 1 if quiet and plant.window == plant.usual else 0
    if plant.quiet >= plant.rest_windows:
        plant.frozen = 1
        plant.frozen_at = plant.now
        for j in range(qpos.shape[0]):
            qvel[j] = 0.0
            rates[j] = 0.0
            before[j] = qpos[j]
        cut.x_m_s = 0.0
        cut.y_m_s = 0.0
        cut.bend_m[0] = 0.0
        cut.bend_m[1] = 0.0
    if plant.uneven:
        thread.feel(parts.screws, axes, parts.drives, parts.states)
    begin_window(memory)
    for i in range(AXES):
        for j in range(qvel.shape[0]):
            axes[i].rest_m_s2 += springs[0, i, j] * (qpos[j] - before[j]) + springs[1, i, j] * (qvel[j] - rates[j])
    if plant.quiet == 0 or by_mujoco or cut.on or feeler.on or parts.supply[0].on:
        plant.settled = 0
    else:
        plant.settled = SAME if _as_kept(memory) and plant.settled else KEPT


@njit(inner=True, nogil=True, error_model="numpy")
def _as_kept(memory):
    """Whether axes, drives and joints are what `kept` has, to the bit; keep them."""
    at, kept = memory[0], parts_of(memory).kept
    same = _keep(at.axes, AXIS_WORDS, kept, 0)
    same = _keep(at.states, STATE_WORDS, kept, AXIS_WORDS) and same
    for k in range(3):
        joints = at.qpos if k == 0 else at.qvel if k == 1 else at.qacc
        same = _keep(joints, at.joints, kept, AXIS_WORDS + STATE_WORDS + k * at.joints) and same
    return same


@njit(inner=True, nogil=True, error_model="numpy")
def _keep(address, count, kept, first):
    """Put the words at an address into `kept`; True if they are there."""
    words, same = array_at(address, (count,), np.int64), True
    for k in range(count):
        same = same and kept[first + k] == words[k]
        kept[first + k] = words[k]
    return same


@njit(inner=True, nogil=True, error_model="numpy")
def _pace(plant, axes, supply, qvel):
    """Choose the next window: fine from when the structure is shaken until it has been calm."""
    shaken = False
    for j in range(qvel.shape[0]):
        if abs(qvel[j]) > SHAKEN_M_S and not (axes[0].dof == j or axes[1].dof == j or axes[2].dof == j):
            shaken = True
    window = plant.window
    if shaken:
        window = plant.fine
        plant.calm = 0
    elif window != plant.usual:
        plant.calm += 1
        if plant.calm >= CALM and plant.now % plant.usual == 0:
            window = plant.usual
    if window != plant.window:
        plant.window = window
        supply.window_s = 1e-9 * plant.substep_ns * window
        supply.charge_decay = math.exp(-supply.window_s / (supply.source_ohm * supply.capacitance_f))


@njit(nogil=True, error_model="numpy")
def look(memory):
    """Reset the least pull-out margins and largest speeds to those of now."""
    parts = parts_of(memory)
    for i in range(AXES):
        parts.axes[i].margin = 1.0
        parts.axes[i].fastest_rad_s = 0.0
    _look(memory)


@njit(inner=True, nogil=True, error_model="numpy")
def _look(memory):
    """Lower the least pull-out margins to those of now, for motors whose stages are on."""
    parts = parts_of(memory)
    plant = parts.plant[0]
    now_ns = plant.now * plant.substep_ns
    supply = parts.supply[0]
    faster = supply.source_v / max(supply.voltage_v, 1.0) if supply.on else 1.0
    for i in range(AXES):
        axis, state = parts.axes[i], parts.states[i]
        if parts.drives[i].kind == SERVO:
            if state.fault != 0:
                now = 0.0
            elif state.on != 0:
                now = 1.0 - abs(state.error) / parts.drives[i].lag_limit
            else:
                continue
        elif axis.phases != OPEN:
            command = parts.commanded[i] - behind(parts.leads[i], now_ns)
            lag = (command - state.theta_rad * axis.steps_per_rad) * axis.full_steps
            speed_rad_s = faster * state.omega_rad_s
            axis.turning_rad_s += 0.1 * (plant.window / plant.usual) * (speed_rad_s - axis.turning_rad_s)
            axis.fastest_rad_s = max(axis.fastest_rad_s, abs(axis.turning_rad_s))
            now = margin.margin(axis.mean_nm, lag, speed_rad_s, parts.available[i], axis.fraction)
        else:
            continue
        axis.margin = min(axis.margin, now)
        axis.untaken = min(axis.untaken, now)


@njit(inner=True, nogil=True, error_model="numpy")
def _take(memory, at):
    """Take a sample: the sub-step `at` (now or, if nothing moves, later), places and speeds of the joints [nv],
    commanded and rotors [m], current fractions, margins and forces on the nuts [3], supply voltage, bending of the
    tool [2]. Places are those `sample_ahead_ns` after it."""
    parts = parts_of(memory)
    plant, axes = parts.plant[0], parts.axes
    if plant.sampled == parts.samples.shape[0]:
        return
    row = parts.samples[plant.sampled]
    plant.sampled += 1
    n, m = parts.qpos.shape[0], parts.commanded.shape[0]
    ahead_ns = plant.sample_ahead_ns
    share = (plant.now % plant.window + ahead_ns / plant.substep_ns) / plant.window
    row[0] = at
    for j in range(n):
        row[1 + j] = parts.before[j] + share * (parts.qpos[j] - parts.before[j])
        row[1 + n + j] = parts.qvel[j]
    at_commands = 1 + 2 * n
    at_ns = at * plant.substep_ns + ahead_ns
    for i in range(m):
        row[at_commands + i] = parts.commanded[i]
        row[at_commands + m + i] = parts.commanded[i] - behind(parts.leads[i], at_ns)
    at_axes = at_commands + 2 * m
    for i in range(AXES):
        axis = axes[i]
        row[1 + axis.dof] = axis.x_m + 1e-9 * ahead_ns * axis.v_m_s
        row[1 + n + axis.dof] = axis.v_m_s
        row[at_commands + m + i] = parts.states[i].theta_rad * axis.steps_per_rad
        if parts.drives[i].kind == SERVO:
            since = at - plant.frozen_at if plant.frozen else 0
            live = axis.phases & parts.supply[0].gate != OPEN and parts.states[i].fault == 0
            row[at_axes + i] = math.sqrt(cool(parts.drives[i], parts.states[i], since)) if live else 0.0
        else:
            row[at_axes + i] = 0.0 if axis.phases & parts.supply[0].gate == OPEN else axis.fraction
        row[at_axes + AXES + i] = axis.margin
        row[at_axes + 2 * AXES + i] = axis.mean_nut_n
    row[at_axes + 3 * AXES] = parts.supply[0].voltage_v if parts.supply[0].on else math.nan
    for i in range(2):
        row[at_axes + 3 * AXES + 1 + i] = parts.cut[0].bend_m[i]


@njit(inner=True, nogil=True, error_model="numpy")
def _feel_tip(memory):
    """Set deflection and push of the feeler by where the tool is over the table."""
    parts = parts_of(memory)
    x_m, y_m, z_m, shape = 0.0, 0.0, 0.0, parts.shape
    for j in range(parts.qpos.shape[0]):
        q = parts.qpos[j]
        for i in range(AXES):
            if parts.axes[i].dof == j:
                q = parts.axes[i].x_m
        x_m += shape[0, j] * q
        y_m += shape[1, j] * q
        z_m += shape[2, j] * q
    touch.feel(parts.feeler[0], parts.targets, x_m, y_m, z_m)


@njit(nogil=True, error_model="numpy")
def feel_now(memory):
    """Let the feeler, and thresholds of it, be as the machine stands."""
    parts = parts_of(memory)
    if parts.feeler[0].on:
        _feel_tip(memory)
        _pass(memory)


@njit(inner=True, nogil=True, error_model="numpy")
def _pass(memory):
    """Compare with all thresholds at the end of a sub-step; True if one was passed or left."""
    parts = parts_of(memory)
    axes, states = parts.axes, parts.states
    now_ns = parts.plant[0].now * parts.plant[0].substep_ns
    changed = False
    for k in range(parts.thresholds.shape[0]):
        threshold = parts.thresholds[k]
        i = threshold.axis
        if threshold.quantity == POSITION:
            beyond = threshold.sense * (axes[i].x_m - threshold.limit)
        elif threshold.quantity == TOUCH:
            beyond = parts.feeler[0].deflected_m - threshold.limit
        elif i >= AXES:
            continue  # no mechanics: no lag, no fault
        elif threshold.quantity == LAG:
            command = parts.commanded[i] - behind(parts.leads[i], now_ns)
            beyond = abs(command - states[i].theta_rad * axes[i].steps_per_rad - states[i].shift) - threshold.limit
        else:
            beyond = 1.0 if axes[i].fault or states[i].fault else -1.0
        passed = beyond > -threshold.hysteresis if threshold.passed else beyond > 0.0
        if passed != (threshold.passed != 0):
            threshold.passed = 1 if passed else 0
            changed = True
    return changed


@njit(inner=True, nogil=True, error_model="numpy")
def _in_position(drives, states):
    """True if all servo drives are."""
    found = True
    for i in range(AXES):
        found = found and states[i].on != 0 and states[i].arrived == drives[i].window_substeps
    return found


@njit(nogil=True, error_model="numpy")
def advance(memory, until_ns, t_ns, delta, early_lead_ns, lead_ns):
    """Advance by whole sub-steps to until_ns, or to the end of the first one in which a threshold was passed or left,
    or two shapes that must not meet were found to touch, or to the first look at which all drives are in position;
    return the ticks made.

    memory [1] MEMORY; t_ns [n], delta int32 [n, m' <= m] ticks in time order; early_lead_ns int64 [e <= n] leads of the
    first ticks, lead_ns that of the others.
    A tick at t belongs to the sub-step in (start, end] and acts in it by the time mean of the command.
    """
    parts = parts_of(memory)
    plant, axes, drives, states = parts.plant[0], parts.axes, parts.drives, parts.states
    commanded, leads, tip_nuts = parts.commanded, parts.leads, parts.tip_nuts
    cut, supply, feeler = parts.cut[0], parts.supply[0], parts.feeler[0]
    qpos, before, place = parts.qpos, parts.before, parts.place
    plant.edge = 0
    plant.arrived = 0
    plant.struck = 0
    dt_ns = plant.substep_ns
    dt_s = 1e-9 * dt_ns
    until = until_ns // dt_ns
    made = 0
    while True:
        if plant.look_every and plant.now == plant.look_at:
            look_ns = plant.now * dt_ns + plant.look_ahead_ns
            if look_ns <= until_ns and _in_position(drives, states):
                until_ns = look_ns
                plant.arrived = 1
                break
            plant.look_at += plant.look_every
        if plant.now >= until:
            break
        if plant.frozen:
            wakes = until if made == t_ns.shape[0] else min(until, (t_ns[made] - 1) // dt_ns)
            for i in range(AXES):
                wakes = min(wakes, _lower_at(axes[i]))
            if plant.look_every and plant.look_at <= wakes:
                if _in_position(drives, states):
                    wakes = plant.look_at
                else:
                    plant.look_at += ((wakes - plant.look_at) // plant.look_every + 1) * plant.look_every
            plant.now = max(plant.now, wakes)
            if plant.sample_every and plant.sample_at <= plant.now:
                if plant.held == 0:
                    _take(memory, plant.sample_at)
                    plant.held = 1
                plant.sample_at += ((plant.now - plant.sample_at) // plant.sample_every + 1) * plant.sample_every
            if plant.now == until or (plant.look_every and plant.now == plant.look_at):
                continue
            _wake(plant, axes, drives, states, supply, feeler)

        end_ns = (plant.now + 1) * dt_ns
        for i in range(AXES):
            if plant.now >= _lower_at(axes[i]):
                axes[i].fraction = axes[i].idle_fraction
            axes[i].command = commanded[i]
        if plant.led_until_ns > end_ns - dt_ns:
            for i in range(AXES):
                if leads[i].end_ns > end_ns - dt_ns:
                    axes[i].command -= mean_behind(leads[i], end_ns - dt_ns, end_ns, dt_ns)
                    axes[i].fraction = 1.0
                    axes[i].still_since = plant.now + 1
        while made < t_ns.shape[0] and t_ns[made] <= end_ns:
            remaining = (end_ns - t_ns[made]) / dt_ns
            tick_lead_ns = early_lead_ns[made] if made < early_lead_ns.shape[0] else lead_ns
            for i in range(delta.shape[1]):
                change = delta[made, i]
                if change == 0:
                    continue
                commanded[i] += change
                if i < AXES:
                    axes[i].command += change * remaining
                    axes[i].fraction = 1.0
                    axes[i].still_since = plant.now + 1
                if tick_lead_ns > 0:
                    before_it = mean_behind(leads[i], t_ns[made], end_ns, dt_ns)
                    begin(leads[i], t_ns[made], change, tick_lead_ns)
                    plant.led_until_ns = max(plant.led_until_ns, leads[i].end_ns)
                    if i < AXES:
                        axes[i].command -= mean_behind(leads[i], t_ns[made], end_ns, dt_ns) - before_it
            made += 1

        if cut.on:
            x_m_s = drives[0].travel_m_per_rad * states[0].omega_rad_s
            teeth.bite(cut, plant.now, x_m_s, drives[1].travel_m_per_rad * states[1].omega_rad_s)
            teeth.bend(cut)
        for i in range(AXES):
            axis = axes[i]
            x_mid_m = axis.x_m + 0.5 * dt_s * axis.v_m_s
            before_rad_s = states[i].omega_rad_s
            phases = axis.phases & supply.gate
            if drives[i].kind == SERVO:
                torque_nm, drag, steady = servo_torque(drives[i], states[i], axis.command, phases)
            else:
                torque_nm, drag, steady = stepper_torque(drives[i], states[i], axis.command, phases, axis.fraction, 0.0)
            nut_n = turn(drives[i], states[i], torque_nm, drag, x_mid_m - axis.zero_m, axis.v_m_s, steady)
            force_n = axis.push_n + nut_n
            if supply.on:
                work_w = 0.5 * (before_rad_s + states[i].omega_rad_s) * states[i].torque_nm
                a_a, b_a = states[i].current_a_a, states[i].current_b_a
                supply.energy_j += dt_s * (work_w + axis.resistance_ohm * (a_a * a_a + b_a * b_a))
            if cut.on:
                force_n += tip_nuts[0, i] * cut.x_n + tip_nuts[1, i] * cut.y_n
            if feeler.on:
                for k in range(AXES):
                    force_n += tip_nuts[k, i] * feeler.push_n[k]
            axis.sum_n += force_n
            axis.sum_nut_n += nut_n
            axis.sum_nm += states[i].torque_nm
            free_m_s = axis.v_m_s + dt_s * (axis.mobility_per_kg * force_n + axis.rest_m_s2)
            stop_m_s = dt_s * axis.mobility_per_kg * axis.friction_n
            free_m_s -= min(stop_m_s, max(-stop_m_s, free_m_s))
            axis.v_m_s = 0.0 if axis.held * free_m_s < 0.0 else free_m_s
            axis.x_m = x_mid_m + 0.5 * dt_s * axis.v_m_s

        if feeler.on:
            for i in range(AXES):
                feeler.sum_n[i] += feeler.push_n[i]
        plant.now += 1
        if plant.now % plant.window == 0:
            for i in range(AXES):
                axes[i].mean_nm = axes[i].sum_nm / plant.window
                axes[i].sum_nm = 0.0
            _look(memory)
            if supply.on:
                feed.feed(supply, axes, drives, states)
            _leave_window(memory)
            if plant.lost_dof >= 0:
                break
            if plant.settled == SAME and plant.look_every == 0:
                wakes = until if made == t_ns.shape[0] else min(until, (t_ns[made] - 1) // dt_ns)
                for i in range(AXES):
                    wakes = min(wakes, _lower_at(axes[i]))
                alike = (min(wakes, plant.sample_at) - plant.now) // plant.window
                alike = max(0, min(alike, plant.rest_windows - 1 - plant.quiet))
                plant.quiet += alike
                plant.now += alike * plant.window
        if plant.now == plant.sample_at:
            _take(memory, plant.now)
            plant.sample_at += plant.sample_every
        if feeler.on:
            _feel_tip(memory)
            if feeler.broken > 1:
                plant.struck = 1
        near = plant.watched != 0
        for i in range(AXES):
            near = near or not axes[i].free_low_m < axes[i].x_m < axes[i].free_high_m
        if (near and _pass(memory)) or plant.struck:
            plant.edge = 1
            break

    # What only MuJoCo knows, the structure, is known at the ends of windows: it comes one window late and smooth.
    ahead_ns = 0 if plant.edge else until_ns - plant.now * dt_ns
    share = (plant.now % plant.window + ahead_ns / dt_ns) / plant.window
    for j in range(qpos.shape[0]):
        place[j] = before[j] + share * (qpos[j] - before[j])
    for i in range(AXES):
        place[axes[i].dof] = axes[i].x_m + 1e-9 * ahead_ns * axes[i].v_m_s
    return made


_PARTS = dynamics, servo, servo_drive, trigonometry, margin, native, teeth
# files whose code the compiled loop contains
CONTAINED = (*memory.CONTAINED, *(str(module.__file__) for module in _PARTS))
contains(__name__, *CONTAINED)
