"""The data of the compiled loop: records of numbers, and one small record with all their addresses.

A call of the loop passes one argument (plant/26), and every field has a name. The arrays belong to `Built` and to
MuJoCo; a MEMORY holds only their addresses.

    Parts of arrays  --- memory_of --->  MEMORY, in C a struct of pointers
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from isel_twin.native import record
from isel_twin.plant import MOST_SAMPLES

AXES = 3  # with mechanics
SAMPLES = MOST_SAMPLES  # samples that can wait to be read
FAR_M = 1e3  # a joint beyond this has run away
NEVER = np.iinfo(np.int64).max  # sub-step or time that does not come

PLANT = record(
    "PLANT",
    [
        ("substep_ns", "i8"),
        ("window", "i8"),  # sub-steps in a MuJoCo step: `usual`, or `fine` while the structure is shaken
        ("usual", "i8"),
        ("fine", "i8"),
        ("calm", "i8"),  # fine windows since it was last shaken
        ("step_at", "i8"),  # address of the time step in the mjModel
        ("rest_windows", "i8"),  # windows of standstill before the plant is frozen
        ("mj_step", "i8"),  # address of the function
        ("model", "i8"),  # address of the mjModel
        ("data", "i8"),  # address of the mjData
        ("now", "i8"),  # sub-steps made since power-on
        ("quiet", "i8"),  # windows of standstill so far
        ("settled", "i8"),  # KEPT: the window before ended as `kept` says; SAME: and so did the last one; 0: not known
        ("frozen", "i8"),  # 1: nothing moves
        ("frozen_at", "i8"),  # sub-step since which it is so
        ("watched", "i8"),  # 1: there are thresholds of other quantities than position
        ("edge", "i8"),  # 1: the last call ended because a threshold was passed or left
        ("led_until_ns", "i8"),  # end of the last of all leads
        ("lost_dof", "i8"),  # number of the joint coordinate that ran away, -1: none
        ("uneven", "i8"),  # 1: a screw is uneven (thread.h)
        ("sample_every", "i8"),  # sub-steps from sample to sample, 0: none are taken
        ("sample_at", "i8"),  # sub-step of the next one
        ("sample_ahead_ns", "i8"),  # and how long after its end it is taken: less than a sub-step
        ("sampled", "i8"),  # samples that wait to be read
        ("look_every", "i8"),  # sub-steps from look to look at whether all drives are in position, 0: there is none
        ("look_at", "i8"),  # sub-step of the next look
        ("look_ahead_ns", "i8"),  # and how long after its end it is: less than a sub-step
        ("arrived", "i8"),  # 1: the last call ended because they are
        ("struck", "i8"),  # 1: two shapes that must not meet began to touch in MuJoCo's last step
        ("held", "i8"),  # 1: frozen and sampled once: further samples would be the same
    ],
)

AXIS = record(
    "AXIS",
    [
        ("dof", "i8"),  # index of the axis joint in qpos and qvel
        ("zero_m", "f8"),  # joint position with rotor angle 0 and the nut in the middle of its backlash
        ("mobility_per_kg", "f8"),  # acceleration per newton at the nut
        ("x_m", "f8"),  # joint position inside the window
        ("v_m_s", "f8"),
        ("rest_m_s2", "f8"),  # a: acceleration by everything but nut, push and guide friction
        ("friction_n", "f8"),  # guide friction
        ("held", "f8"),  # +1, -1: a stop or a collision pushes this way, 0: nothing does
        ("sum_n", "f8"),  # sum of the forces of this window
        ("mean_n", "f8"),  # mean force of the window before
        ("sum_nut_n", "f8"),  # sum of the forces of the nut alone in this window
        ("mean_nut_n", "f8"),  # their mean in the window before
        ("push_n", "f8"),  # force on the nut that would accelerate the carriage as the push from outside does
        ("phases", "i8"),  # as `stepper_torque` takes it
        ("fraction", "f8"),  # current fraction
        ("idle_fraction", "f8"),
        ("idle_delay", "i8"),  # sub-steps from the last change of the command to the lowered current
        ("lowering", "i8"),  # 1: the controller asks for lowered current at rest
        ("still_since", "i8"),  # sub-step after the last one with a change, or in which the stage came on
        ("steps_per_rad", "f8"),  # microsteps of the command in a radian of the rotor
        ("full_steps", "f8"),  # full steps in a microstep
        ("sum_nm", "f8"),  # sum of the torques of the currents in this window
        ("mean_nm", "f8"),  # their mean in the window before
        ("margin", "f8"),  # least pull-out margin since the last reset (margin.py)
        ("untaken", "f8"),  # the same since it was last taken
        ("turning_rad_s", "f8"),  # speed of the rotor without its swing: low pass over ten windows
        ("fastest_rad_s", "f8"),  # the largest of it since the last reset
        ("fault", "i8"),  # 1: the drive has switched itself off: under-voltage of a common supply
        ("command", "f8"),  # time mean of the command in this sub-step
        ("resistance_ohm", "f8"),  # of a phase with what the stage adds
        ("inductance_h", "f8"),
        ("own_w", "f8"),  # what the stage uses for itself while on
        ("supply_factor", "f8"),  # part of the supply that can drive a current
        ("free_low_m", "f8"),  # between these no position switch of the axis changes
        ("free_high_m", "f8"),
    ],
)

KEPT, SAME = 1, 2  # of `settled`
APART, TOUCHING, FRESH = 0, 1, 2  # of two shapes that must not meet; fresh: nobody has been told
PARTED_MM = 0.5  # by which they have to part to be apart again (plant/20)

POSITION, LAG, FAULT, TOUCH = 0, 1, 2, 3  # quantities of thresholds
IN_C = (
    "AXES",
    "SAMPLES",
    "FAR_M",
    "NEVER",
    "KEPT",
    "SAME",
    "APART",
    "FRESH",
    "PARTED_MM",
    "POSITION",
    "LAG",
    "TOUCH",
)  # records.h has them, too

# passed when sense * (position - limit) > 0 or |lag| - limit > 0 or there is a fault, left hysteresis below that
THRESHOLD = record(
    "THRESHOLD",
    [
        ("quantity", "i8"),
        ("axis", "i8"),
        ("sense", "f8"),
        ("limit", "f8"),  # m, microsteps
        ("hysteresis", "f8"),
        ("passed", "i8"),
    ],
)


class Parts(NamedTuple):
    """All that the loop works on, by reference; float64 unless said. nv: number of joints, the carriages among them."""

    plant: Any  # PLANT [1]
    axes: Any  # AXIS [3]
    drives: Any  # AXIS_PARAMETERS [3]
    screws: Any  # SCREW [3]
    states: Any  # AXIS_STATE [3]
    thresholds: Any  # THRESHOLD [k]
    commanded: Any  # int64 [m], microsteps, m >= 3
    leads: Any  # LEAD [m]
    available: Any  # [3, s], margin.py
    joints_law: Any  # JOINT [nv], glide.h
    mobility: Any  # [nv, nv], glide.h
    push: Any  # [2, nv], forces on the joints beside `push_n`: now, and a correction of this window's sum
    springs: Any  # [2, 3, nv], acceleration of each carriage by deflection and speed of each joint on its spring
    cut: Any  # CUT [1]
    tip_nuts: Any  # [3, 3], force on the nuts by a newton between tool and table along X, Y and Z
    tip_joints: Any  # [3, nv], the rest of it on the joints
    feeler: Any  # FEELER [1], touch.py
    targets: Any  # TARGET [t], what it can touch
    shape: Any  # [3, nv], tool over table by the joints
    supply: Any  # SUPPLY [1]
    before: Any  # [nv], joint positions one window ago
    rates: Any  # [nv], joint velocities one window ago
    touching: Any  # int64 [p], of each pair of clamped.py: APART, TOUCHING, FRESH
    touched_m: Any  # [p, 3], where X, Y and Z were when MuJoCo last found each pair in contact
    found: Any  # [p], MuJoCo's contacts of each pair at the beginning of its last step
    samples: Any  # [SAMPLES, w], rows of `take_sample`
    kept: Any  # int64 [w], axes, states and joints at the end of a window of standstill, bit by bit
    place: Any  # [nv], joint positions at the end of the last call, within a sub-step along their velocities
    qpos: Any  # [nv], this and the rest as MuJoCo names its arrays
    qvel: Any
    qacc: Any
    qacc_smooth: Any
    qfrc: Any


# Addresses and sizes of the parts: passing thirty arrays would take longer than computing a millisecond of
# motion. Keep the arrays alive as long as this.
_POINTED = {name: "double" for name in Parts._fields} | {
    "plant": "PLANT",
    "axes": "AXIS",
    "drives": "AXIS_PARAMETERS",
    "screws": "SCREW",
    "states": "AXIS_STATE",
    "thresholds": "THRESHOLD",
    "commanded": "int64_t",
    "leads": "LEAD",
    "joints_law": "JOINT",
    "cut": "CUT",
    "feeler": "FEELER",
    "targets": "TARGET",
    "supply": "SUPPLY",
    "touching": "int64_t",
    "kept": "int64_t",
}
_SIZES = "joints", "number_of_thresholds", "commands", "speeds", "fields", "pairs", "number_of_targets", "words"
MEMORY = record("MEMORY", [(name, "i8") for name in (*Parts._fields, *_SIZES)], _POINTED)


def memory_of(parts: Parts) -> NDArray[np.void]:
    """MEMORY [1] of these arrays. Raises TypeError for an array that is not contiguous."""
    memory = np.zeros(1, MEMORY)
    for name, array in zip(parts._fields, parts, strict=True):
        if not array.flags.c_contiguous:
            raise TypeError(f"{name}: the compiled loop takes arrays in one piece")
        memory[name] = array.ctypes.data
    memory["joints"] = len(parts.qpos)
    memory["number_of_thresholds"] = len(parts.thresholds)
    memory["commands"] = len(parts.commanded)
    memory["speeds"] = parts.available.shape[1]
    memory["pairs"] = len(parts.touching)
    memory["number_of_targets"] = len(parts.targets)
    memory["fields"] = parts.samples.shape[1]
    memory["words"] = len(parts.kept)
    return memory
