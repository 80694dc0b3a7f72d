"""A machine whose numbers are hidden, and an experiment on it: the same for all tests here, as it takes seconds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from isel_twin.language import create_language, needed
from isel_twin.machine import Machine, load_machine, with_overrides
from isel_twin.many.identification.experiment import Block, Experiment, assemble, blocks
from isel_twin.many.identification.measured import Measured
from isel_twin.many.identification.session import Session, session_of
from isel_twin.many.identification.stand_in import carry_out
from isel_twin.many.identification.unknowns import Unknown, unknown
from isel_twin.recordings.reading import Recorded
from tests.near import COARSE, near_switches

CONTROLLER = "imc-s8"
NAMES = ("friction.x", "backlash.x", "stiffness.x", "supply")
TRUE = (2.0, 0.03, 0.7, 40.0)
"""Of NAMES: twice the friction, 1.5 times the backlash, 0.7 times the stiffness, another supply."""
GAUGE_MM = 0.005


@dataclass(frozen=True)
class Found:
    """What was done to the hidden machine."""

    believed: Machine
    hidden: Machine
    unknowns: tuple[Unknown, ...]
    experiments: tuple[Experiment, ...]
    recorded: tuple[Recorded, ...]
    measured: tuple[Measured, ...]
    sessions: tuple[Session, ...]


def hide(machine: Machine) -> Machine:
    """The machine with the true values."""
    x = machine.axes[0]
    return with_overrides(
        machine,
        {
            "axes.x.guide_friction": TRUE[0] * x.guide_friction_n,
            "axes.x.shaft_coulomb": TRUE[0] * x.screw.coulomb_nm,
            "axes.x.shaft_viscous": TRUE[0] * x.screw.viscous_nm_s_per_rad,
            "axes.x.backlash": TRUE[1],
            "axes.x.stiffness": TRUE[2] * 30.0,
            "structure.flex_x.stiffness": TRUE[2] * 5.0,
            "axes.all.stage.supply": TRUE[3],
        },
    )


def wanted(found: list[Block], *names: str) -> list[Block]:
    """The first block of each name, in this order."""
    return [next(block for block in found if block.name.startswith(name)) for name in names]


def short(block: Block) -> Block:
    """The same at its top speed over a shorter way, and half as many places."""
    if block.stall is not None:
        return replace(block, stall=replace(block.stall, from_mm=4.0, to_mm=14.0))
    return replace(block, steps=block.steps[: len(block.steps) // 2]) if block.name.startswith("reversal") else block


@pytest.fixture(scope="session")
def found(tmp_path_factory: pytest.TempPathFactory) -> Found:
    """Two sessions at the hidden machine, with other moves and other luck: one to fit, one to hold back."""
    believed = load_machine(near_switches(tmp_path_factory.mktemp("near"), 2.0, more=COARSE))
    hidden = hide(believed)
    unknowns = tuple(unknown(believed, name) for name in NAMES)
    language = needed(create_language(CONTROLLER), CONTROLLER)
    experiments, recordings, measurements, sessions = [], [], [], []
    for seed, name in enumerate(("first", "second")):
        every = blocks(believed, CONTROLLER, ["x"], unknowns, seed)
        coasts = [block for block in every if block.name.startswith("coast")]
        pieces = wanted(every, "reversal", "stall x 1000")
        taken = [coasts[2], *wanted(every, "push"), *pieces] if seed == 0 else [*coasts[1:], *pieces]
        experiment = assemble(name, [short(block) for block in taken], language)
        recorded, measured = carry_out(
            experiment, hidden, CONTROLLER, seed=60 + seed, noise_mm=GAUGE_MM, time_noise_s=0.0005
        )
        experiments.append(experiment)
        recordings.append(recorded)
        measurements.append(measured)
        sessions.append(session_of(recorded, measured, CONTROLLER, believed))
    return Found(
        believed,
        hidden,
        unknowns,
        tuple(experiments),
        tuple(recordings),
        tuple(measurements),
        tuple(sessions),
    )
