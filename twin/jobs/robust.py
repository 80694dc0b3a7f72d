"""Is the outcome of a job luck? The job is repeated on machines that one can buy: as makers and shops spread them.

Near stall the behaviour is chaotic in narrow bands: one speed loses everything, slightly more or less loses nothing.
One run cannot tell such a job from a reliable one. So it is repeated on other machines, each drawn from seed and number
of the repetition:

    start       another power-on position of each carriage, so another rotor angle and another scatter of the switches
    winding     warm by 0 to 76 K, the same on all axes: R up to 30 % more, magnets 0.12 % a kelvin weaker
    motor       of each axis: R normal 4 % (at most 10), L normal 8 % (at most 20; a delivery alike but for 3 %), torque
                constant +-8 %, rotor inertia normal 5 %, detent log-normal 25 %, iron loss 40 %, its knee 30 %
    stage       of each axis: current normal 3 %, part of the supply that drives it normal 5 % (at most 10)
    supply      -12 to +4 %: transformer and rectifier
    friction    of guides and of screws log-normal 35 %, by a third in common (temperature)
    screw       efficiency 0.80 to 0.95, stiffness log-normal 35 % (downwards only), backlash log-normal 50 %
    frame       stiffness log-normal 35 % (downwards only), damping log-normal 47 %; squareness log-normal 50 %
    load        each moving mass normal 5 %, the payload +-10 %

Sources: tolerances printed on sheets (R 10 %, L 20 %), catalogues (friction, efficiency, stiffness), the rest estimates
whose 95 % range is half to twice (jobs/7). A log-normal draw is cut at twice its size.

A job is robust if it is well (jobs/4), and all repetitions end as it does: accepted or not, and on each axis lost or
not. Of n repetitions without a loss one knows that losses are no more frequent than `at_most`, with 95 % confidence.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.crew import Crew, Stop, in_order
from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.quiet import quietly
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.playing import played
from isel_twin.jobs.verdict import Verdict
from isel_twin.machine import Machine, with_overrides

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.job import Line

COPPER_PER_K, MAGNET_PER_K = 0.00393, -0.0012
STIFFER = 0.95  # most: the time step of the machine allows hardly more
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Repetition:
    """A repetition of a job and its outcome."""

    number: int  # from 1
    seed: int  # of the twin: power-on positions, switch scatter, bounce
    factors: Mapping[str, float]  # of the machine's numbers, by their keys (`perturbation`)
    verdict: Verdict


def perturbation(machine: Machine, seed: int, number: int) -> tuple[int, dict[str, float], dict[str, Any]]:
    """Seed of a twin, factors and machine overrides of a repetition; the same for the same seed and number. The factors
    have the keys of the machine file."""
    random = np.random.default_rng([seed, number])
    twin_seed = int(random.integers(2**31))
    draws = _Draws(random, machine.tree)
    tree = machine.tree
    hot = random.uniform(1.0, 1.3)
    delivery, grease = draws.normal(0.08), random.standard_normal()
    supply = random.uniform(0.88, 1.04)
    for name in CARRIAGES:
        axis = f"axes.{name}"
        if "servo" in tree["axes"][name]:
            draws.put(f"{axis}.servo.supply", supply)
        else:
            warmer_k = (hot - 1.0) / COPPER_PER_K
            draws.put(f"{axis}.stage.supply", supply)
            draws.put(f"{axis}.stage.current", draws.normal(0.03))
            draws.put(f"{axis}.specimen.resistance", hot * draws.normal(0.04))
            draws.put(f"{axis}.specimen.inductance", np.clip(delivery * draws.normal(0.03), 0.8, 1.2))
            flux = 1.0 + MAGNET_PER_K * warmer_k
            draws.put(f"{axis}.specimen.torque_constant", flux * random.uniform(0.92, 1.08))
            draws.put(f"{axis}.specimen.rotor_inertia", draws.normal(0.05))
            draws.put(f"{axis}.specimen.detent_torque", draws.log_normal(0.25))
            draws.put(f"{axis}.specimen.iron_loss", draws.log_normal(0.4))
            draws.put(f"{axis}.specimen.iron_knee", draws.log_normal(0.3))
            draws.put(f"{axis}.specimen.supply_factor", np.clip(draws.normal(0.05), 0.9, 1.1))
        draws.put(f"{axis}.guide_friction", draws.log_normal(0.35, grease))
        screw = draws.log_normal(0.35, grease)
        draws.put(f"{axis}.shaft_coulomb", screw)
        draws.put(f"{axis}.shaft_viscous", screw)
        draws.put(f"{axis}.efficiency", random.uniform(0.80, 0.95) / tree["axes"][name]["efficiency"]["value"])
        draws.put(f"{axis}.stiffness", min(STIFFER, draws.log_normal(0.35)))
        draws.put(f"{axis}.backlash", draws.log_normal(0.5))
    for key in tree["squareness"]:
        draws.put(f"squareness.{key}", draws.log_normal(0.5))
    for mode in tree["structure"]:
        draws.put(f"structure.{mode}.stiffness", min(STIFFER, draws.log_normal(0.35)))
        draws.put(f"structure.{mode}.damping_ratio", draws.log_normal(0.47))
    for mass in tree["masses"]:
        draws.put(f"masses.{mass}", draws.normal(0.05))
    draws.put("payload.mass", random.uniform(0.9, 1.1))
    return twin_seed, draws.factors, draws.overrides


class _Draws:
    """Factors of a machine's numbers, and the overrides that go with them."""

    def __init__(self, random: np.random.Generator, tree: Mapping[str, Any]) -> None:
        self.factors: dict[str, float] = {}
        self.overrides: dict[str, Any] = {}
        self._random, self._tree = random, tree

    def put(self, key: str, factor: float) -> None:
        entry: Any = self._tree
        for name in key.split("."):
            entry = entry[name]
        self.factors[key] = float(factor)
        self.overrides[key] = entry["value"] * float(factor)

    def normal(self, size: float) -> float:
        """Around 1, cut at two and a half times its size."""
        return 1.0 + size * float(np.clip(self._random.standard_normal(), -2.5, 2.5))

    def log_normal(self, size: float, common: float = 0.0) -> float:
        """Median 1, cut at twice its size. common: a normal draw that others have, too, with correlation 0.3."""
        own = self._random.standard_normal()
        drawn = math.sqrt(0.3) * common + math.sqrt(0.7) * own if common else own
        return math.exp(size * float(np.clip(drawn, -2.0, 2.0)))


def at_most(lost: int, of: int) -> float:
    """Upper bound of the frequency of losses, with CONFIDENCE, if so many of so many were lost (Clopper and Pearson):
    the frequency at which so few would be a matter of 5 %."""
    if lost >= of:
        return 1.0

    def so_few(frequency: float) -> float:
        return sum(math.comb(of, k) * frequency**k * (1.0 - frequency) ** (of - k) for k in range(lost + 1))

    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if so_few(middle) > 1.0 - CONFIDENCE else (low, middle)
    return high


def separates(trials: Sequence[Repetition]) -> tuple[str, float, float] | None:
    """What tells losers from the others best: key, and its median factor on both sides. None with less than two of
    either. Best: the largest share of pairs of a loser and another that stand in the same order."""
    lost = [trial.factors for trial in trials if any(trial.verdict.lost)]
    held = [trial.factors for trial in trials if not any(trial.verdict.lost)]
    if len(lost) < 2 or len(held) < 2:
        return None
    best, found = 0.0, None
    for key in lost[0]:
        mine, theirs = np.array([factors[key] for factors in lost]), np.array([factors[key] for factors in held])
        share = float((mine[:, None] > theirs).mean())
        if abs(share - 0.5) > best:
            best, found = abs(share - 0.5), (key, float(np.median(mine)), float(np.median(theirs)))
    return found


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
    with quietly():
        return Repetition(number, seed, factors, played(twin, lines, timeout_s=timeout_s).verdict)
