"""A cut: the forces of a milling cutter on tool and workpiece, tooth by tooth.

Shows the effect of a working spindle on following, vibration and margin, by the smallest model that has teeth (Y.
Altintas, Manufacturing Automation, chapter 2): a force in proportion to the section of the chip,

    h = f sin(phi)        f = v T: feed of a tooth,  T = 1 / (teeth x turns a second),  v: speed of tool over workpiece
    F_t = kc a h^(1-m) + e a       against the motion of the tooth;  a: depth of cut, h in mm
    F_r = r kc a h^(1-m) + e_r a   from the workpiece towards the axis of the tool

kc is the specific cutting force of a chip of 1 mm and m Kienzle's exponent (materials.py), or kc that of chips of this
thickness and m 0; e and e_r are what the edge takes whatever the chip, by a blunt tool more.

                 left of the feed                    phi from 0 (left) by 90 degrees (ahead) to 180 (right): the spindle
                    ^ phi = 0                        turns clockwise, seen from above
                    |  .-.
                    | (   ) --> feed, phi = 90       along the feed    - F_t cos(phi) - F_r sin(phi)
                    |  '-'                           to its left       + F_t sin(phi) - F_r cos(phi)
                    |

for every tooth between entry and exit. A cutter with all its width in the material cuts from 0 to 180 degrees; with
e = acos(1 - 2 width / diameter) one that climbs has the material on its right and cuts from 180 - e on, a conventional
one on its left, up to e. Without m and edge the power is always kc x depth x width x feed speed.

v is that of the screws (rotor speed times lead), behind a first-order lag of T. Vibration of the frame does not change
the chip: the teeth force vibration, which never feeds itself (no chatter, plant/13). Below 1 um/s there is no chip, and
none is thicker than the cutter's radius.

On a machine with a spindle the teeth turn with it, and load it (`turn`, `torque_nm`).

A tool of which it is said how far it sticks out bends (plant/28): a cantilever of two parts, loaded at its end, on the
spring of its holder. The tip goes with the force, behind a lag of T, without mass: 3 mm of carbide, 20 mm out, ring at
6 kHz. Where the tool is includes it; chips do not, as with the frame.

    tip / F = 1 / k_holder + 64 / (3 pi E) (l^3 / (core D)^4 + (L^3 - l^3) / shank^4)     L: stickout, l: fluted part

Not modelled: removal of material (the event gives the depth), feed along Z, helix and edge radius, wear; a tool that
leans in its holder, and a force above its end (0.75 depth / L of the bending less).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.parameters import check, flag, number, word
from isel_twin.native import record

# state of a cut; all zero: none
CUT = record(
    "CUT",
    [
        ("on", "i8"),
        ("flutes", "i8"),
        ("start", "i8"),  # sub-step in which the first tooth was at phi = 0
        ("turns", "f8"),  # turns of the spindle in a sub-step
        ("tooth_s", "f8"),  # T
        ("gain", "f8"),  # of the lag of T in a sub-step
        ("most_m_s", "f8"),  # feed beyond which chips do not get thicker
        ("n_per_m", "f8"),  # F_t / h of a chip of 1 mm, without that of the edge
        ("m", "f8"),
        ("radial", "f8"),  # F_r / F_t, both without that of the edge
        ("edge_n", "f8"),
        ("edge_radial_n", "f8"),
        ("enter_rad", "f8"),
        ("leave_rad", "f8"),
        ("left", "f8"),  # +1 if left of X is Y, seen from above, -1 if it is -Y
        ("x_m_s", "f8"),  # feed behind the lag, machine coordinates
        ("y_m_s", "f8"),
        ("x_n", "f8"),  # force on the tool in this sub-step
        ("y_n", "f8"),
        ("sum_x_n", "f8"),  # sums of this window
        ("sum_y_n", "f8"),
        ("tool_m_per_n", "f8"),  # by which tool and holder give way
        ("bend_m", "f8", (2,)),  # of the tip over the spindle along X and Y, behind the lag
    ],
)

MODULUS_PA = {"carbide": 600e9, "hss": 210e9}  # Young's, of fine-grained grades: 580 to 620; of steels: 200 to 220
CORE = 0.8  # of the diameter: a shaft that bends as the fluted part does; 0.75 to 0.85 by number of flutes (Kops, Vo)
FLUTED = 2.5  # diameters that are fluted: the short and long rows of DIN 6527 have 2 to 2.7

_CHORDS = 64  # of the arc of engagement, where the torque has no closed form: 1e-4 of it


@dataclass(frozen=True)
class Cut:
    """A cutter in the material. Raises ValueError for a number out of range and a width beyond the diameter."""

    diameter_mm: float = number("mm", 0.1, 100.0, key="diameter")
    flutes: int = number("1", 1.0, 12.0, key="flutes", whole=True)
    depth_mm: float = number("mm", 0.001, 100.0, key="depth")  # along the axis of the tool
    width_mm: float = number("mm", 0.001, 100.0, key="width")  # across the feed; the diameter is a slot
    # clockwise, seen from above; without effect on a machine with a spindle, whose speed counts
    spindle_rpm: float = number("1/min", 60.0, 60_000.0, key="spindle")
    # specific cutting force: of a chip of 1 mm, or with m = 0 of chips of this thickness
    kc_n_mm2: float = number("N/mm2", 0.1, 20_000.0, key="kc")
    radial: float = number("1", 0.0, 2.0, key="radial", optional=True, default=0.3)  # radial over tangential force
    m: float = number("1", 0.0, 0.9, key="m", optional=True, default=0.0)  # Kienzle's exponent
    # what the edge takes on a millimetre of depth: tangential, and towards the axis
    edge_n_mm: float = number("N/mm", 0.0, 1000.0, key="edge", optional=True, default=0.0)
    edge_radial_n_mm: float = number("N/mm", 0.0, 1000.0, key="edge_radial", optional=True, default=0.0)
    climb: bool = flag(default=True)  # the material is on the right of the feed; without effect in a slot
    # of the tool out of its holder; 0: it does not bend
    stickout_mm: float = number("mm", 0.0, 300.0, key="stickout", optional=True, default=0.0)
    # diameter of what is not fluted; 0: that of the cutter
    shank_mm: float = number("mm", 0.0, 100.0, key="shank", optional=True, default=0.0)
    flute_length_mm: float = number(
        "mm", 0.0, 300.0, key="flute_length", optional=True, default=0.0
    )  # 0: 2.5 diameters
    tool_material: str = word(*MODULUS_PA, default="carbide")

    def __post_init__(self) -> None:
        check(self)
        if not self.stickout_mm and (self.shank_mm or self.flute_length_mm):
            raise ValueError("cut: shank and flute_length are those of a tool that bends; give its stickout, too")
        if self.width_mm > self.diameter_mm:
            raise ValueError(f"cut: width must be at most the diameter, {self.diameter_mm:g} mm, not {self.width_mm!r}")


def tool_m_per_n(cut: Cut, holder_n_per_m: float) -> float:
    """By how much the tip gives way across the tool, with the holder; 0 for a tool of no stickout."""
    if not cut.stickout_mm:
        return 0.0
    fluted_mm = min(cut.stickout_mm, cut.flute_length_mm or FLUTED * cut.diameter_mm)
    fluted = fluted_mm**3 / (CORE * cut.diameter_mm) ** 4
    smooth = (cut.stickout_mm**3 - fluted_mm**3) / (cut.shank_mm or cut.diameter_mm) ** 4
    return 1.0 / holder_n_per_m + 64e3 / (3.0 * math.pi * MODULUS_PA[cut.tool_material]) * (fluted + smooth)


def torque_nm(cut: Cut, feed_mm_s: float, turns_rev_min: float) -> float:
    """Torque that the teeth take from the spindle, on the mean of a turn: z / 2 pi times the integral of F_t r."""
    radius_mm = 0.5 * cut.diameter_mm
    feed_mm = min(feed_mm_s * 60.0 / (turns_rev_min * cut.flutes), radius_mm)  # of a tooth
    if feed_mm_s < 1e-3:
        return 0.0
    engaged = math.acos(1.0 - 2.0 * cut.width_mm / cut.diameter_mm)
    if cut.m:
        step = engaged / _CHORDS
        chips = (feed_mm * math.sin((i + 0.5) * step) for i in range(_CHORDS))
        chip = step * sum(h ** (1.0 - cut.m) for h in chips)
    else:
        chip = feed_mm * cut.width_mm / radius_mm  # 1 - cos, in closed form
    force_n = cut.depth_mm * (cut.kc_n_mm2 * chip + cut.edge_n_mm * engaged)
    return cut.flutes / (2.0 * math.pi) * force_n * 1e-3 * radius_mm


def turn(cuts: NDArray[np.void], turns_rev_min: float, now: int, substep_s: float) -> None:
    """Give the cutter of cuts[0] another speed; its teeth stay where they are, to half a sub-step."""
    record = cuts[0]
    turns_hz = turns_rev_min / 60.0
    angle = math.fmod((now - record["start"]) * float(record["turns"]), 1.0)
    ratio = turns_hz * substep_s / float(record["turns"])
    record["most_m_s"] *= ratio
    record["turns"] = turns_hz * substep_s
    record["start"] = now - round(angle / (turns_hz * substep_s))
    record["tooth_s"] = 1.0 / (turns_hz * record["flutes"])
    record["gain"] = -math.expm1(-substep_s * turns_hz * record["flutes"])


def set_cut(
    cuts: NDArray[np.void],
    cut: Cut | None,
    now: int,
    substep_s: float,
    left: float,
    holder_n_per_m: float = math.inf,
) -> None:
    """Begin a cut in cuts[0], or end it. now: sub-step; left: +1 if left of X is Y, seen from above, -1 if -Y.

    The sums of the window so far stay.
    """
    record = cuts[0]
    record["on"] = cut is not None
    for name in ("x_m_s", "y_m_s", "x_n", "y_n"):
        record[name] = 0.0
    record["bend_m"] = 0.0
    if cut is None:
        return
    angle = math.acos(1.0 - 2.0 * cut.width_mm / cut.diameter_mm)
    turns_hz = cut.spindle_rpm / 60.0
    record["flutes"] = cut.flutes
    record["start"] = now
    record["turns"] = turns_hz * substep_s
    record["tooth_s"] = 1.0 / (turns_hz * cut.flutes)
    record["gain"] = -math.expm1(-substep_s * turns_hz * cut.flutes)
    record["most_m_s"] = 0.5e-3 * cut.diameter_mm * turns_hz * cut.flutes
    record["n_per_m"] = cut.kc_n_mm2 * 1e6 * cut.depth_mm * 1e-3
    record["m"] = cut.m
    record["radial"] = cut.radial
    record["edge_n"] = cut.edge_n_mm * cut.depth_mm
    record["edge_radial_n"] = cut.edge_radial_n_mm * cut.depth_mm
    record["enter_rad"] = math.pi - angle if cut.climb else 0.0
    record["leave_rad"] = math.pi if cut.climb else angle
    record["left"] = left
    record["tool_m_per_n"] = tool_m_per_n(cut, holder_n_per_m)
