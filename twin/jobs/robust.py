"""Is the outcome of a job luck? It is repeated on other machines, each drawn from seed and number of the repetition.

Near stall the behaviour is chaotic in narrow bands: one speed loses everything, slightly more or less loses nothing.
One run cannot tell such a job from a reliable one. The machines are one of two sorts, of one description
(machine/spread.py):

    kind     machines that one can buy, on any day: whether a job holds on others of its kind (`--robust`)
    known    this machine, as far as its numbers are known: a number that was measured hardly varies, an estimate much;
             what `identify` finds narrows it (`--uncertain`)

What goes together is drawn together:

    start       kind: another power-on position of each carriage, so another rotor angle; both: another scatter of the
                switches
    winding     kind: warm by 0 to 76 K, the same on all axes: R up to 30 % more, magnets 0.12 % a kelvin weaker
    inductance  of a delivery alike but for 3 %
    friction    of guides and of screws by a third in common (temperature)
    supply      the same on all axes
    stage       of one kind on all axes (jobs/19): a decay that nobody has said, the current at rest and its delay
    stiffness   kind: downwards only, as the time step of the machine allows hardly more; known: the step is halved

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
from isel_twin.core.finer import finely
from isel_twin.core.spec import TwinSpec
from isel_twin.drives.stage import Stage
from isel_twin.jobs.playing import played
from isel_twin.jobs.verdict import Verdict
from isel_twin.machine import Machine, with_overrides
from isel_twin.machine.ranges import held
from isel_twin.machine.spread import FAST_STAGES, LAWS, MIXED_DECAY, Source, numbers, own, within

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.job import Line

COPPER_PER_K, MAGNET_PER_K = 0.00393, -0.0012
MOST_REPETITIONS = 10_000  # a month of work for most jobs
OPTIONS: Mapping[Source, str] = {"kind": "robust", "known": "uncertain"}  # of the command line
STIFFER = 0.95  # most: the time step of the machine allows hardly more
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Repetition:
    """A repetition of a job and its outcome."""

    number: int  # from 1
    seed: int  # of the twin: power-on positions, switch scatter, bounce
    factors: Mapping[str, float]  # of the machine's numbers, by their keys (`perturbation`)
    verdict: Verdict
    places_mm: tuple[tuple[float, ...], ...] = ()  # of the carriages after each line, if `known`


def perturbation(
    machine: Machine, seed: int, number: int, source: Source = "kind"
) -> tuple[int, dict[str, float], dict[str, Any]]:
    """Seed of a twin, factors and machine overrides of a repetition; the same for the same seed, number and source. The
    factors have the keys of the machine file."""
    random = np.random.default_rng([seed, number])
    twin_seed = int(random.integers(2**31))
    tree = machine.tree
    draws = _Draws(random, tree, np.random.default_rng([seed, number, 1]) if source == "known" else None)
    hot = random.uniform(1.0, 1.3)
    if source == "known":
        hot = 1.0  # R and flux of the file are those of the machine as it was known, at its temperature
    delivery, grease = draws.of("specimen.inductance"), random.standard_normal()
    supply = draws.of("stage.supply")
    for name in CARRIAGES:
        axis = f"axes.{name}"
        if "servo" in tree["axes"][name]:
            draws.put(f"{axis}.servo.supply", supply, "supply")
        else:
            warmer_k = (hot - 1.0) / COPPER_PER_K
            draws.put(f"{axis}.stage.supply", supply, "supply")
            draws.put(f"{axis}.stage.current", draws.of("stage.current"))
            draws.put(f"{axis}.specimen.resistance", hot * draws.of("specimen.resistance"))
            draws.put(f"{axis}.specimen.inductance", np.clip(delivery * draws.normal(0.03), 0.8, 1.2))
            flux = 1.0 + MAGNET_PER_K * warmer_k
            draws.put(f"{axis}.specimen.torque_constant", flux * draws.of("specimen.torque_constant"))
            for part in ("rotor_inertia", "detent_torque", "iron_loss", "iron_knee"):
                draws.put(f"{axis}.specimen.{part}", draws.of(f"specimen.{part}"))
            draws.put(f"{axis}.specimen.supply_factor", np.clip(draws.of("specimen.supply_factor"), 0.9, 1.1))
        draws.put(f"{axis}.guide_friction", draws.of("guide_friction", grease))
        screw = draws.of("shaft_coulomb", grease)
        draws.put(f"{axis}.shaft_coulomb", screw)
        draws.put(f"{axis}.shaft_viscous", screw)
        draws.put(f"{axis}.efficiency", draws.of("efficiency") / tree["axes"][name]["efficiency"]["value"])
        draws.put(f"{axis}.stiffness", min(STIFFER, draws.of("stiffness")))
        draws.put(f"{axis}.backlash", draws.of("backlash"))
    for key in tree["squareness"]:
        draws.put(f"squareness.{key}", draws.of("squareness"))
    for mode in tree["structure"]:
        draws.put(f"structure.{mode}.stiffness", min(STIFFER, draws.of("structure.stiffness")))
        draws.put(f"structure.{mode}.damping_ratio", draws.of("structure.damping_ratio"))
    for mass in tree["masses"]:
        draws.put(f"masses.{mass}", draws.of("masses"))
    draws.put("payload.mass", draws.of("payload"))
    for of in machine.axes:
        if isinstance(of.stage, Stage) and of.stage.damping_gain:  # last, as few have it
            draws.put(f"axes.{of.name}.specimen.damping_gain", draws.of("specimen.damping_gain"))
    later = [np.random.default_rng([seed, number, stream]) for stream in (2, 3)]  # whatever is drawn before
    draws.stages([of.name for of in machine.axes if isinstance(of.stage, Stage)], *later)
    if source == "known":
        draws.rest()
    return twin_seed, draws.factors, draws.overrides


class _Draws:
    """Factors of a machine's numbers, and the overrides that go with them."""

    def __init__(
        self, random: np.random.Generator, tree: Mapping[str, Any], knowledge: np.random.Generator | None
    ) -> None:
        """knowledge: for what a number of this machine says of itself, which goes before the law of its kind."""
        self.factors: dict[str, float] = {}
        self.overrides: dict[str, Any] = {}
        self._random, self._tree, self._knowledge = random, tree, knowledge
        self._shared: dict[str, float] = {}

    def put(self, key: str, factor: float, shared: str = "") -> None:
        """shared: numbers of this name, known with the same interval, are drawn as one."""
        entry: Any = self._tree
        for name in key.split("."):
            entry = entry[name]
        value = entry["value"]
        if self._knowledge is not None and value and (interval := own(key, entry)) is not None:
            deviations = float(self._knowledge.standard_normal())
            if shared:
                deviations = self._shared.setdefault(f"{shared} {value} {interval}", deviations)
            factor = within(value, interval, deviations) / value
        drawn = value * float(factor)
        self.overrides[key] = held(key, drawn)
        self.factors[key] = float(factor) if self.overrides[key] == drawn else self.overrides[key] / value

    def stages(self, axes: Sequence[str], random: np.random.Generator, knowledge: np.random.Generator) -> None:
        """What is not known of the stages, which are of one kind: how a current falls, and how it is lowered at rest.
        The factor of a kind is the part of the time in which a current falls against the supply, 1: fast."""
        drawn = "fast" if random.uniform() < FAST_STAGES else "mixed"
        mixed = float(random.uniform(MIXED_DECAY.low, MIXED_DECAY.high))
        before, self._random = (self._random, self._knowledge), random
        self._knowledge = self._knowledge and knowledge
        lowered, delay = self.of("stage.idle_current"), self.of("stage.idle_delay")
        for name in axes:
            key, stage = f"axes.{name}.stage", self._tree["axes"][name]["stage"]
            given = isinstance(stage["kind"], str) or stage["kind"]["grade"] != "estimate"
            kind = (stage["kind"] if isinstance(stage["kind"], str) else stage["kind"]["value"]) if given else drawn
            if kind == "mixed" and stage["mixed_decay"]["grade"] == "estimate":
                self.overrides[f"{key}.mixed_decay"] = mixed
            if not given:
                self.overrides[f"{key}.kind"] = kind
            if not given or f"{key}.mixed_decay" in self.overrides:
                self.factors[f"{key}.kind"] = mixed if kind == "mixed" else 1.0
            self.put(f"{key}.idle_current", lowered, "idle_current")
            self.put(f"{key}.idle_delay", delay, "idle_delay")
        self._random, self._knowledge = before

    def rest(self) -> None:
        """Numbers of no kind that tell an interval of their own, if anything depends on them."""
        for key, entry in numbers(self._tree):
            effect = not key.endswith(".lead_error") or self._tree["imperfections"]["lead_error"]
            if key.startswith("guides."):
                flag = "abbe" if key.startswith(("guides.turn", "guides.arm")) else "straightness"
                effect = self._tree["imperfections"].get(flag, False)
            if effect and key not in self.factors and entry["value"] and own(key, entry) is not None:
                self.put(key, 1.0)

    def of(self, kind: str, common: float = 0.0) -> float:
        """A draw of the law of this kind. common: a normal draw that others have, too, with correlation 0.3."""
        law = LAWS[kind]
        if law.shape == "uniform":
            return float(self._random.uniform(law.low, law.high))
        return self.normal(law.size) if law.shape == "normal" else self.log_normal(law.size, common)

    def normal(self, size: float) -> float:
        """Around 1, cut at two and a half times its size."""
        return 1.0 + size * float(np.clip(self._random.standard_normal(), -2.5, 2.5))

    def log_normal(self, size: float, common: float = 0.0) -> float:
        """Median 1, cut at twice its size. common: a normal draw that others have, too, with correlation 0.3."""
        own = self._random.standard_normal()
        drawn = math.sqrt(0.3) * common + math.sqrt(0.7) * own if common else own
        return math.exp(size * float(np.clip(drawn, -2.0, 2.0)))


def losses(trials: Sequence[Repetition]) -> tuple[int, int]:
    """How many repetitions lost steps, and of how many: one that lost none and was not made to its end tells nothing
    (jobs/18)."""
    lost = sum(any(trial.verdict.lost) for trial in trials)
    return lost, lost + sum(not any(trial.verdict.lost) and not trial.verdict.part for trial in trials)


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


def check(call: TwinSpec, number: int, source: Source = "kind") -> None:
    """Check, before any computation, that a call can be repeated.

    Raises CallError for a plant without physics, on which no perturbation can have an effect, and if none of these
    machines can be built.
    """
    option = OPTIONS[source]
    if number > MOST_REPETITIONS:
        raise CallError(f"{option} {number}: must be up to {MOST_REPETITIONS} repetitions", option=True)
    if call.plant == "kinematic":
        raise CallError(f"{option}: the kinematic plant loses no steps; use --plant mujoco", option=True)
    with call_errors():
        machine, built = call.fitted(), not number
        for n in range(1, number + 1):
            try:
                with_overrides(machine, perturbation(machine, call.seed, n, source)[2])
            except ValueError:
                if n == number and not built:
                    raise
            else:
                built = True


def repetitions(
    call: TwinSpec,
    lines: Sequence[Line],
    number: int,
    *,
    timeout_s: float,
    flash: bytes | None = None,
    crew: Crew | None = None,
    stop: Stop | None = None,
    source: Source = "kind",
) -> Iterator[Repetition]:
    """Repeat a job on other machines; results come in the order of their numbers, with any crew. A machine that cannot
    be built is left out.

    flash: image of the controller's flash memory at the beginning of the job; the call's file is not written. crew:
    None: in this process, on demand. stop: called now and then; True ends the iteration.
    """
    repeat = functools.partial(_repetition, call, lines, timeout_s, flash, source)
    return (made for made in in_order(repeat, range(1, number + 1), crew, stop) if made is not None)


def agree(verdict: Verdict, other: Verdict) -> bool:
    """True if two runs of a job ended alike: accepted or not, as expected or not, and lost or not on each axis."""
    end, other_end = ((v.ok, v.refused, v.unmet, v.lost) for v in (verdict, other))
    return end == other_end


def perturbed_twin(
    call: TwinSpec, number: int, flash: bytes | None = None, source: Source = "kind"
) -> tuple[Twin, int, dict[str, float]]:
    """The twin of a repetition, its seed and its factors; the call's flash file is not written."""
    machine = call.fitted()
    seed, factors, overrides = perturbation(machine, call.seed, number, source)

    start_mm = None
    if source == "known":
        from isel_twin.core.assembly import chances, power_on_mm

        start_mm = tuple(power_on_mm(machine, chances(call.seed)[0], call.start_mm).tolist())

    def built(more: Mapping[str, float]) -> Twin:
        overrides_now = {**call.overrides, **overrides, **more}
        return call.with_(seed=seed, flash=flash, overrides=overrides_now, start_mm=start_mm).build()

    return (built({}) if source == "kind" else finely(machine, built)), seed, factors


def _repetition(
    call: TwinSpec, lines: Sequence[Line], timeout_s: float, flash: bytes | None, source: Source, number: int
) -> Repetition | None:
    """Depends only on its arguments, so that it can run in another process. None if there is no such machine."""
    try:
        twin, seed, factors = perturbed_twin(call, number, flash, source)
    except ValueError:
        return None
    with quietly():
        made = played(twin, lines, timeout_s=timeout_s, edges=source == "known")  # of the others nobody asks
    places = tuple(result.position_mm for result in made.results) if source == "known" else ()
    return Repetition(number, seed, factors, made.verdict, places)
