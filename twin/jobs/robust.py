"""Is the outcome of a job luck? The job is repeated on machines that differ as machines of one kind do.

Near stall the behaviour is chaotic in narrow bands: one speed loses everything, slightly more or less loses nothing.
One run cannot tell such a job from a reliable one. So it is repeated with small perturbations, each drawn from seed and
number of the repetition:

    start       another power-on position of each carriage, so another rotor angle and another scatter of the switches
    supply      of all stages, +-5 %: mains and load of an unregulated supply
    friction    of each axis (guide, shaft), +-20 %: temperature and age of the grease
    load        each moving mass and the payload, +-10 %

A job is robust if it is well (jobs/4), and all repetitions end as it does: accepted or not, and on each axis lost or
not.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.crew import Crew, Stop, in_order
from isel_twin.base.errors import CallError, call_errors
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.playing import played
from isel_twin.jobs.verdict import Verdict
from isel_twin.machine import Machine, with_overrides

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.job import Line

SUPPLY = 0.05  # largest part by which the supply of the stages differs
FRICTION = 0.2  # largest part by which the friction of an axis differs
LOAD = 0.1  # largest part by which each mass differs
FRICTION_KEYS = ("guide_friction", "shaft_coulomb", "shaft_viscous")  # of an axis


@dataclass(frozen=True)
class Repetition:
    """A repetition of a job and its outcome."""

    number: int  # from 1
    seed: int  # of the twin: power-on positions, switch scatter, bounce
    factors: Mapping[str, float]  # of the machine's numbers: supply, friction_x .. friction_z, and each mass
    verdict: Verdict


def perturbation(machine: Machine, seed: int, number: int) -> tuple[int, dict[str, float], dict[str, Any]]:
    """Seed of a twin, factors and machine overrides of a repetition; the same for the same seed and number."""
    draw = np.random.default_rng([seed, number])
    twin_seed = int(draw.integers(2**31))
    factors: dict[str, float] = {}
    overrides: dict[str, Any] = {}

    def drawn(name: str, most: float) -> float:
        factors[name] = 1.0 + most * draw.uniform(-1.0, 1.0)
        return factors[name]

    tree = machine.tree
    supply = drawn("supply", SUPPLY)
    for name in CARRIAGES:
        axis, friction = tree["axes"][name], drawn(f"friction_{name}", FRICTION)
        drive = "servo" if "servo" in axis else "stage"
        overrides[f"axes.{name}.{drive}.supply"] = axis[drive]["supply"]["value"] * supply
        overrides |= {f"axes.{name}.{key}": axis[key]["value"] * friction for key in FRICTION_KEYS}
    for name, mass in tree["masses"].items():
        overrides[f"masses.{name}"] = mass["value"] * drawn(name, LOAD)
    overrides["payload.mass"] = tree["payload"]["mass"]["value"] * drawn("payload", LOAD)
    return twin_seed, factors, overrides


def check(call: TwinSpec, number: int) -> None:
    """Check, before any computation, that a call can be repeated this often.

    Raises CallError for a plant without physics, on which no perturbation can have an effect, and for a machine whose
    numbers leave their limits when perturbed.
    """
    if call.plant == "kinematic":
        raise CallError("robust: the kinematic plant loses no step whatever one perturbs; take mujoco", option=True)
    with call_errors():
        machine = call.fitted()
        for n in range(1, number + 1):
            with_overrides(machine, perturbation(machine, call.seed, n)[2])


def repetitions(
    call: TwinSpec,
    lines: Sequence[Line],
    number: int,
    *,
    timeout_s: float,
    flash: bytes | None = None,
    crew: Crew | None = None,
    stop: Stop | None = None,
) -> Iterator[Repetition]:
    """Repeat a job with small perturbations; results come in the order of their numbers, with any crew.

    flash: image of the controller's flash memory at the beginning of the job; the call's file is not written. crew:
    None: in this process, on demand. stop: called now and then; True ends the iteration.
    """
    repeat = functools.partial(_repetition, call, lines, timeout_s, flash)
    return in_order(repeat, range(1, number + 1), crew, stop)


def agree(verdict: Verdict, other: Verdict) -> bool:
    """True if two runs of a job ended alike: accepted or not, as expected or not, and lost or not on each axis."""
    end, other_end = ((v.ok, v.refused, v.unmet, v.lost) for v in (verdict, other))
    return end == other_end


def perturbed_twin(call: TwinSpec, number: int, flash: bytes | None = None) -> tuple[Twin, int, dict[str, float]]:
    """The twin of a repetition, its seed and its factors; the call's flash file is not written."""
    seed, factors, overrides = perturbation(call.fitted(), call.seed, number)
    spec = call.with_(seed=seed, flash=flash, overrides={**call.overrides, **overrides}, start_mm=None)
    return spec.build(), seed, factors


def _repetition(
    call: TwinSpec, lines: Sequence[Line], timeout_s: float, flash: bytes | None, number: int
) -> Repetition:
    """Depends only on its arguments, so that it can run in another process."""
    twin, seed, factors = perturbed_twin(call, number, flash)
    return Repetition(number, seed, factors, played(twin, lines, timeout_s=timeout_s).verdict)
