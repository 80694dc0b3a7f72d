"""The parameters of a job, and the job with other settings.

    whole job        3 parameters: rapid speed, acceleration, start-stop frequency
    each move        3 for each move with a rapid, 2 for others; lines of the same text share them

A rapid has a speed of `rapid_hz` or more in the job, by default half of the fastest speed there; slower moves are feeds
that a process needs (many/4).

Parameters are within the ranges of the controller's language, not below half of the job's values, and speeds not above
that from which on every axis fails; beyond it only as far as an edge below 1 is asked for (many/22).
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from isel_twin.controller import offers
from isel_twin.core.spec import TwinSpec
from isel_twin.drives.servo_drive import ServoDrive
from isel_twin.jobs.job import Line, parse_job
from isel_twin.language import (
    SETTINGS_RANGES,
    JobMove,
    LanguageError,
    MoveSettings,
    RetimesJobs,
    create_language,
    needed,
)
from isel_twin.machine import Axis, with_overrides

# names of `MoveSettings`; speeds are searched linearly, ramps logarithmically
SETTINGS = ("speed_hz", "acceleration_hz_per_ms", "start_stop_hz")
SLOWEST = 2  # the job's value divided by this is the lowest that is tried

_LINE_END = re.compile(r"(\r\n|\r|\n)")


@dataclass(frozen=True)
class Parameter:
    """One number to find."""

    name: str  # `speed_hz`, or `speed_hz.9` for the moves with the text of line 9
    setting: str
    low: int
    high: int

    @property
    def log(self) -> bool:
        """True if searched on a logarithmic scale."""
        return self.setting != "speed_hz"

    def nearest(self, value: int) -> int:
        return min(max(value, self.low), self.high)


@dataclass(frozen=True)
class Group:
    name: str  # line number of the first of them; "" if they are all moves of the job
    moves: tuple[JobMove, ...]
    parameters: tuple[Parameter, ...]

    def own(self, values: Mapping[str, int]) -> dict[str, int]:
        """The values of its own parameters."""
        return {parameter.name: values[parameter.name] for parameter in self.parameters}

    def parameter(self, setting: str) -> str:
        """The name of its parameter for this setting."""
        return f"{setting}.{self.name}" if self.name else setting


@dataclass(frozen=True)
class Candidate:
    text: str
    lines: tuple[Line, ...]
    first: int  # number of the line with which the first move begins: that of its ramps, or the move
    moves: tuple[int, ...]  # numbers of the lines of all moves, as `Problem.moves` has them


def fails_from_hz(axis: Axis) -> float:
    """The speed from which on an axis fails whatever its acceleration: a stepper motor swings itself out of step, a
    servo drive lags by more than its limit (many/13)."""
    if isinstance(axis.stage, ServoDrive):
        return axis.stage.lag_limit * axis.stage.position_gain_per_s / max(1.0 - axis.stage.feed_forward, 1e-3)
    return axis.swing_limit_rad_s * axis.steps_per_rev / (2.0 * math.pi)


@dataclass(frozen=True)
class Problem:
    """A job on a machine, and its parameters. Raises ValueError or CallError for one that cannot be tuned."""

    text: str  # text of the job file
    call: TwinSpec = field(default_factory=TwinSpec)
    each_move: bool = False
    rapid_hz: int | None = None
    ranges: Mapping[str, tuple[int, int]] = field(default_factory=dict)  # ranges within the language's, by SETTINGS
    repetitions: int = 5  # number of other machines of the kind for judging a setting, beside the machine as it is
    uncertain: int = 0  # and of machines that this one may be, as far as it is known
    timeout_s: float = 3600.0
    # a motor that turns at 1/e of the speed from which on it swings keeps a margin of 1 - speed_share/e
    speed_share: float = 1.0
    edge: float = 1.0  # least e that is asked for; below 1, as much higher speeds are tried
    flash: bytes | None = None  # image of the controller's flash memory
    settle_mm: float | None = None  # a move is over when its carriages ring by no more than this; None: with its line

    def __post_init__(self) -> None:
        if self.call.plant == "kinematic":
            raise ValueError("the kinematic plant loses no step whatever one sets; take mujoco")
        if strange := next((name for name in self.ranges if name not in self.language.ranges), None):
            raise ValueError(f"{strange}: {self.call.controller} has none")
        if not self.moves:
            raise ValueError("there is no move in the job that settings could be brought to")
        if not any(group.parameters for group in self.groups):
            raise ValueError("nothing is left to be tried: every range is a single number")

    @property
    def may_be(self) -> tuple[int, ...]:
        """Numbers of the repetitions on machines that this one may be (judge.py)."""
        return tuple(-number for number in range(1, self.uncertain + 1))

    @cached_property
    def language(self) -> RetimesJobs:
        """The controller's language. Raises LanguageError if it cannot change settings in a job."""
        language = needed(create_language(self.call.controller), self.call.controller)
        if not offers(language, RetimesJobs):
            raise LanguageError(
                f"the language of {self.call.controller} cannot bring settings into a job; isel_twin.envs tunes moves"
            )
        return language

    @cached_property
    def lines(self) -> tuple[Line, ...]:
        return tuple(self._parsed(self.text))

    def _parsed(self, text: str) -> list[Line]:
        return parse_job(text, create_language(self.call.controller), self.call.controller)

    @property
    def is_program(self) -> bool:
        """True for a program of the controller: its last line starts it."""
        return bool(self.lines) and bool(self.lines[-1].program)

    @cached_property
    def rows(self) -> tuple[Line, ...]:
        """What the language retimes: the lines, or those of the program's text."""
        if not self.is_program:
            return self.lines
        return tuple(
            Line(number, row, ()) for number, row in enumerate(_LINE_END.split(self.text)[::2], 1) if row.strip()
        )

    @cached_property
    def moves(self) -> Sequence[JobMove]:
        return self.language.job_moves([row.command for row in self.rows])

    @cached_property
    def fails_from_hz(self) -> int:
        """The highest speed that need be tried: beyond it every axis fails, whatever its acceleration, or swings more
        than the edge allows that is asked for."""
        allowed = min(1.0, self.edge)
        axes = self.call.fitted().axes
        return round(min(max(fails_from_hz(axis) / (1.0 if axis.closed_loop else allowed) for axis in axes), 1e9))

    @cached_property
    def rapid_from_hz(self) -> int:
        """Speed from which a move is a rapid."""
        if self.rapid_hz is not None:
            return self.rapid_hz
        return max(1, max((speed for move in self.moves for speed in move.speeds_hz), default=0) // 2)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Moves that share their settings."""
        if not self.each_move:
            return (self._group("", tuple(self.moves)),)
        alike: dict[str, list[JobMove]] = {}
        for move in self.moves:
            alike.setdefault(self.rows[move.line].command, []).append(move)
        return tuple(self._group(str(self.rows[moves[0].line].number), tuple(moves)) for moves in alike.values())

    def _group(self, name: str, moves: tuple[JobMove, ...]) -> Group:
        group = Group(name, moves, ())
        return replace(group, parameters=tuple(filter(None, (self._parameter(group, one) for one in SETTINGS))))

    def _parameter(self, group: Group, setting: str) -> Parameter | None:
        now = self._now(group, setting)
        if setting not in self.language.ranges or not now:  # the controller has none; no rapid
            return None
        low, high = self._range(setting)
        if setting not in self.ranges:
            low = max(low, min(now) // SLOWEST)
        return Parameter(group.parameter(setting), setting, low, high) if low < high else None

    def _range(self, setting: str) -> tuple[int, int]:
        """The range of a setting. Raises ValueError for one that the controller does not take."""
        if setting not in self.language.ranges:
            return SETTINGS_RANGES[setting]
        low, high = self.language.ranges[setting]
        if setting not in self.ranges:
            return low, min(high, self.fails_from_hz) if setting == "speed_hz" else high
        asked_low, asked_high = self.ranges[setting]
        if not low <= asked_low <= asked_high <= high:
            raise ValueError(f"{setting} {asked_low}:{asked_high}: {self.call.controller} takes {low} to {high}")
        return asked_low, asked_high

    def _now(self, group: Group, setting: str) -> list[int]:
        """The values of a group's moves in the job; only speeds of rapids."""
        if setting == "speed_hz":
            return [speed for move in group.moves for speed in move.speeds_hz if speed >= self.rapid_from_hz]
        return [getattr(move, setting) for move in group.moves]

    @property
    def parameters(self) -> list[Parameter]:
        return [parameter for group in self.groups for parameter in group.parameters]

    def nearest(self) -> dict[str, int]:
        """The parameters nearest to the job as it is."""
        return {
            parameter.name: parameter.nearest(max(self._now(group, parameter.setting)))
            for group in self.groups
            for parameter in group.parameters
        }

    def settings(self, values: Mapping[str, int]) -> dict[int, MoveSettings]:
        """Settings of each move, by its line from 0, for these values of all parameters."""
        made = {}
        for group in self.groups:
            chosen = {name: self._chosen(group, name, values) for name in SETTINGS}
            made.update(dict.fromkeys((move.line for move in group.moves), MoveSettings(**chosen)))
        return made

    def _chosen(self, group: Group, setting: str, values: Mapping[str, int]) -> int:
        low, high = self._range(setting)
        if (name := group.parameter(setting)) in values:
            return values[name]
        return min(max(max(self._now(group, setting), default=low), low), high)

    def candidate(self, values: Mapping[str, int]) -> Candidate:
        """The job with these values of the parameters."""
        return self._with(self.settings(values), self.rapid_from_hz)

    def as_it_stands(self) -> Candidate:
        if self.is_program:
            return Candidate(self.text, self.lines, self.lines[-1].number, (self.lines[-1].number,))
        numbers = tuple(self.lines[move.line].number for move in self.moves)
        return Candidate(self.text, self.lines, numbers[0], numbers)

    def defaults(self) -> Candidate:
        """The job with its own speeds and the default ramps of the controller."""
        speed_hz, _ = self._range("speed_hz")
        settings = MoveSettings(speed_hz=speed_hz, **self.language.defaults)
        none = 1 + max(speed for move in self.moves for speed in (*move.speeds_hz, 0))
        return self._with({move.line: settings for move in self.moves}, none)

    def _with(self, settings: Mapping[int, MoveSettings], rapid_hz: int) -> Candidate:
        made = self.language.retimed([row.command for row in self.rows], settings, rapid_hz)
        text = _rewritten(self.text, self.rows, made)
        lines = tuple(self._parsed(text))
        if self.is_program:
            return Candidate(text, lines, lines[-1].number, (lines[-1].number,))
        ends = list(itertools.accumulate(len(each) for each in made))
        numbers = tuple(lines[ends[move.line] - 1].number for move in self.moves)
        first = self.moves[0].line
        return Candidate(text, lines, lines[ends[first] - len(made[first])].number, numbers)

    def about(self) -> dict[str, Any]:
        """All that results depend on, in JSON's types; a study belongs to exactly these."""

        def digest(data: bytes) -> str:
            return hashlib.sha256(data).hexdigest()[:16]

        call = self.call
        tree = with_overrides(call.as_built, call.overrides).tree
        clamped = {"fixtures": digest(repr(call.fixtures).encode())} if call.fixtures else {}
        return {
            "job": digest(self.text.encode()),
            "machine": digest(json.dumps(tree, sort_keys=True, default=str).encode()),
            "controller": call.controller,
            "plant": call.plant,
            "seed": call.seed,
            "scenario": digest(call.scenario.read_bytes()) if call.scenario is not None else "",
            "flash memory": digest(self.flash or b""),
            "number of repetitions": self.repetitions,
            "share of speed": self.speed_share,
            "speed of rapid ways": self.rapid_from_hz,
            "choice of parameters": digest(repr(self.parameters).encode()),
            **({} if self.settle_mm is None else {"settling": self.settle_mm}),
            **({"number of machines that it may be": self.uncertain} if self.uncertain else {}),
            **({"line": [call.line_speed, call.adapter_ms]} if call.line_speed else {}),
            **clamped,
        }


def _rewritten(text: str, lines: Sequence[Line], made: Sequence[Sequence[str]]) -> str:
    """The text of a job with other commands; comments, blanks and expectations stay."""
    pieces = _LINE_END.split(text)
    end = pieces[1] if len(pieces) > 1 else "\n"
    for line, (*before, own) in zip(lines, made, strict=True):
        at = 2 * (line.number - 1)
        if own != line.command:
            pieces[at] = pieces[at].replace(line.command, own, 1)
        pieces[at] = "".join(f"{each}{end}" for each in before) + pieces[at]
    return "".join(pieces)
