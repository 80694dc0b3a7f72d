"""An axis on the bench: moves of a shaft without a nut, and a drive with a free carriage on its nut."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.curves import follow, mean_command
from isel_twin.drives.dynamics import axis_parameters
from isel_twin.drives.library import MOTORS
from isel_twin.drives.motor import Motor
from isel_twin.drives.screw import Screw
from isel_twin.drives.shaft import axis_states
from isel_twin.drives.stage import Stage
from isel_twin.native import Core

rigs = Core(Path(__file__).with_name("rigs.c"))
DT = 25e-6

X_AXIS = Screw(inertia_kgm2=4.3e-5, coulomb_nm=0.12, viscous_nm_s_per_rad=2e-4)
"""20 kg on a 5 mm screw of 16 mm by 0.6 m: 9.6e-5 kg m^2 with the rotor of the 23HS32."""


def trapezoid(steps: int, start_hz: float, speed_hz: float, hz_per_s: float) -> NDArray[np.float64]:
    """Phase of a move at the borders of the sub-steps, with 0.2 s of rest before and 0.5 s after it."""
    ramp_s = (speed_hz - start_hz) / hz_per_s
    cruise_s = (steps - (start_hz + speed_hz) * ramp_s) / speed_hz
    assert cruise_s > 0
    total_s = 2 * ramp_s + cruise_s
    t = np.arange(round((total_s + 0.7) / DT) + 1) * DT - 0.2
    up = np.clip(t, 0, ramp_s)
    flat = np.clip(t - ramp_s, 0, cruise_s)
    down = np.clip(t - ramp_s - cruise_s, 0, ramp_s)
    phase = start_hz * up + hz_per_s * up**2 / 2 + speed_hz * (flat + down) - hz_per_s * down**2 / 2
    return np.where(t >= total_s, float(steps), np.clip(phase, 0, steps))


@dataclass(frozen=True)
class Outcome:
    lost_full_steps: float
    rotor_rad: float
    at_rest: bool


def travel(
    phase: NDArray[np.float64],
    stage: Stage,
    motor: Motor = MOTORS["23HS32-4004S"],
    screw: Screw = X_AXIS,
    load_nm: float = 0.0,
) -> Outcome:
    """What is left when a move is over: command minus rotor in full steps. The load rises in the rest before it."""
    parameters, states = axis_parameters(motor, stage, screw, DT), axis_states(1)
    command = mean_command(phase)
    load = load_nm * np.clip(np.arange(len(command)) * DT / 0.15, 0.0, 1.0)
    follow(parameters, states, command, load, np.inf)
    rotor_rad = float(states["theta_rad"][0])
    lost = phase[-1] / stage.microsteps - rotor_rad * motor.full_steps_per_rev / (2 * math.pi)
    return Outcome(float(lost), rotor_rad, bool(states["at_rest"][0]))


@dataclass(frozen=True)
class Record:
    """What a rig did, float64 [n] each."""

    theta_rad: NDArray[np.float64]
    omega_rad_s: NDArray[np.float64]
    x_m: NDArray[np.float64]
    v_m_s: NDArray[np.float64]
    force_n: NDArray[np.float64]
    energy_j: NDArray[np.float64]
    at_rest: NDArray[np.float64]


class Rig:
    """A drive whose nut pushes a carriage that slides without friction; a force of push_n pulls at it."""

    def __init__(self, screw: Screw, mass_kg: float = 20.0, motor: Motor = MOTORS["23HS32-4004S"]) -> None:
        self.parameters = axis_parameters(motor, Stage(supply_v=48, current_a=4.2, microsteps=8), screw, DT)
        self.state = axis_states(1)
        self.mass_kg = mass_kg
        self.x_m = self.v_m_s = 0.0

    def run(self, seconds: float, *, command: float = 0.0, phases: int = 0, push_n: float = 0.0) -> Record:
        """Let time pass; arrays of what happened, one entry a sub-step."""
        return self.follow(np.full(round(seconds / DT), command), phases=phases, push_n=push_n)

    def follow(self, command: NDArray[np.float64], *, phases: int, push_n: float = 0.0) -> Record:
        """The same along a command for each sub-step."""
        record = np.zeros((len(command), 7))
        start = self.x_m, self.v_m_s
        rigs.couple(self.parameters, self.state, command, phases, self.mass_kg, push_n, *start, record)
        self.x_m, self.v_m_s = record[-1, 2:4]
        return Record(*record.T)
