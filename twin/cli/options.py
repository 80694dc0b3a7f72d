"""Options that several commands share, each with one name and one meaning, and their checks.

    --machine --controller --plant --seed --flash --scenario --set   which twin (TwinOptions)
    --workers     processes that share the work, without effect on results
    --line-speed, --adapter-ms    the time of the serial line (LineOptions)
    --timeout     virtual seconds to wait for a reply
    --format --zero   how a file of a CAM program is taken (CamOptions)
    --robust      repetitions on other machines of the kind, as one can buy them
    --uncertain   repetitions on what this machine may be, as far as its numbers are known
    --json        output for programs
    --out, -o     the main output file; --steps --vcd --trace --report --picture --record: further files

The ending of a name decides what is written, or is refused (`written`). Files that can be made again are replaced.
Recordings of a real machine, and golden runs, need --replace.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

from cyclopts import Parameter, Token

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.files import kind_of
from isel_twin.core.spec import MACHINE, TwinSpec

if TYPE_CHECKING:
    from io import BufferedReader

    from isel_twin.base.crew import Crew
    from isel_twin.jobs.toolpaths import Reading


def _whole_number(_: Any, tokens: Sequence[Token]) -> int:
    """A whole number; cyclopts alone would round 1.5. Raises ValueError."""
    word = tokens[0].value
    try:
        return int(word)
    except ValueError:
        raise ValueError(f"{word} is no whole number") from None


NEEDED = {".parquet": ("pyarrow", "trace"), **dict.fromkeys((".png", ".svg", ".pdf"), ("matplotlib", "report"))}
PAGE = ".html", ".htm"
PICTURE = ".png", ".svg", ".pdf"
TRACES = ".npz", ".vcd", ".parquet", ".csv"
RECORDING = ".mcap"
OF_ONE_KIND = {*PAGE, *PICTURE, *TRACES, RECORDING, ".fmu", ".golden", ".sarif", ".toml", ".xml"}


@dataclass(frozen=True)
class Ending:
    """Checks the name of what a command writes; a validator of its parameter. kinds: endings it may have, each of them
    what is written then; none: any but those of another kind of file, for jobs, folders and the like. bare: without an
    ending it is the first kind."""

    kinds: tuple[str, ...] = ()
    bare: bool = False

    def __call__(self, _: Any, name: Path | str | None) -> None:
        """Raises ValueError."""
        if name is None or is_standard_input(path := Path(name)):  # which `check_writable` refuses
            return
        if not self.kinds:
            if (kind := path.suffix.lower()) in OF_ONE_KIND and not path.is_dir():
                raise ValueError(f"{name}: no {kind} is written here; choose a name with another ending")
            return
        from importlib.util import find_spec

        package, extra = NEEDED.get(kind_of(path, self.kinds, self.bare), ("", ""))
        if package and find_spec(package) is None:
            raise ValueError(f"{name}: needs {package}: pip install 'isel-twin[{extra}]'")


def written(help: str, *kinds: str, bare: bool = False, name: str | Sequence[str] | None = None) -> Parameter:
    """The parameter of a file that a command writes, or of a folder; the others as for `Ending`."""
    return Parameter(name=name, help=help, validator=Ending(kinds, bare))


Whole = Annotated[int, Parameter(converter=_whole_number)]
MachineName = Annotated[str, Parameter(help="Name of a machine (see `machines`) or path of a machine folder.")]
ControllerName = Annotated[str, Parameter(help="Name of a controller (see `controllers`).")]
PlantName = Annotated[str, Parameter(help="mujoco: physics. kinematic: the carriage follows the counter.")]
Seed = Annotated[Whole, Parameter(help="A number: seed of power-on positions, switch scatter and bounce.")]
ScenarioFile = Annotated[Path | None, Parameter(help="Timed events (TOML): hood, E-stop, faults, forces.")]
FlashPath = Annotated[Path | None, Parameter(help="The controller's flash memory; created if missing.")]
Overrides = Annotated[
    tuple[str, ...], Parameter(help="KEY=VALUE: a machine parameter, such as payload.mass=8. May be repeated.")
]
Workers = Annotated[
    Whole, Parameter(help="Number of processes that share the work; what comes out does not depend on it.")
]
Cluster = Annotated[str | None, Parameter(help="A dask scheduler, tcp://HOST:PORT, in place of processes.")]
Robust = Annotated[
    Whole, Parameter(help="Number of other machines, as one can buy them, on which the job is repeated.")
]
Uncertain = Annotated[
    Whole, Parameter(help="Number of machines that this one may be, as far as its numbers are known: bands.")
]
Timeout = Annotated[float, Parameter(help="Virtual seconds after which a missing reply is given up.")]
Json = Annotated[bool, Parameter(help="JSON for programs.")]
Replace = Annotated[bool, Parameter(help="Replace files that exist.")]
Interval = Annotated[float, Parameter(help="Time between two samples of a trace, in virtual seconds.")]

Ptys = Annotated[
    list[str] | None,
    Parameter(help="A pseudo terminal, and a link to it if a name is given. The default. May be repeated."),
]
Tcps = Annotated[list[str] | None, Parameter(help="HOST:PORT for raw TCP; port 0: a free one. May be repeated.")]
Rfc2217s = Annotated[
    list[str] | None, Parameter(help="HOST:PORT for RFC 2217 (Telnet with line settings). May be repeated.")
]


@Parameter(name="*")
@dataclass(frozen=True)
class TwinOptions:
    """The twin that a command builds."""

    machine: MachineName = MACHINE
    controller: ControllerName = TwinSpec.controller
    plant: PlantName = TwinSpec.plant
    seed: Seed = TwinSpec.seed
    flash: FlashPath = None
    scenario: ScenarioFile = None
    set: Overrides = ()

    def spec(self, *, line_speed: bool = False) -> TwinSpec:
        """The spec of this twin. Raises CallError for a wrong --set."""
        chosen = self.machine, self.controller, self.plant, self.seed, self.scenario, self.flash
        return TwinSpec(*chosen, line_speed, parse_overrides(self.set))

    @property
    def files(self) -> tuple[Path | None, ...]:
        """Files that the twin reads or keeps, which no output may replace."""
        return self.flash, self.scenario


@Parameter(name="*")
@dataclass(frozen=True)
class SessionTwin(TwinOptions):
    """The twin that is driven as in a recording, and compared with it."""

    controller: Annotated[
        str, Parameter(help="Its controller, whose language frames the commands, if the recording does not say.")
    ] = ""
    flash: Annotated[Path | None, Parameter(help="The controller's flash memory; only read.")] = None


@Parameter(name="*")
@dataclass(frozen=True)
class LineOptions:
    """The line between host and controller, where its time counts."""

    line_speed: Annotated[
        Whole | None, Parameter(help="Bytes take their time on the line, at this speed in bit/s. Without, none.")
    ] = None
    adapter_ms: Annotated[
        float | None, Parameter(help="Number of ms after which a USB adapter hands replies on; FTDI: 16.")
    ] = None

    def on(self, call: TwinSpec) -> TwinSpec:
        """The call with this line. Raises CallError."""
        try:
            return call.with_(**{name: value for name, value in vars(self).items() if value is not None})
        except ValueError as error:
            raise CallError(str(error), option=True) from None


NO_LINE = LineOptions()


@Parameter(name="*")
@dataclass(frozen=True)
class CamOptions:
    """Reading of files of CAM programs."""

    form: Annotated[
        str | None,
        Parameter(name="--format", help="Format of the job file, whatever it looks like: ncp, gcode, hpgl, excellon."),
    ] = None
    zero: Annotated[
        str | None,
        Parameter(
            help="Zero of the work as the counters show it, X,Y,Z in mm; fit: the nearest with which all is in travel.",
            allow_leading_hyphen=True,
        ),
    ] = None

    def reading(self) -> Reading:
        """Raises CallError for a zero that is none."""
        from isel_twin.jobs.toolpaths import FIT, Reading

        if self.zero is None or self.zero == FIT:
            return Reading(self.form, None if self.zero is None else FIT)
        return Reading(self.form, parse_places("zero", self.zero, "100,80,60, or fit"))


AS_IT_LOOKS = CamOptions()
DEFAULT_TWIN = TwinOptions()
DEFAULT_SESSION_TWIN = SessionTwin()
TOKEN = "ISEL_TWIN_TOKEN"  # environment variable
TOKEN_CHARACTERS = 4096
STANDARD_INPUT = "/dev/stdin"  # the file for `-`
STREAMS = {STANDARD_INPUT: "standard input", "/dev/stdout": "standard output"}
MOST_MM = 1e5  # of a place, either way
LONGEST_S = 1e9  # longest time of an option in virtual seconds, as for scenarios


def is_standard_input(path: Path) -> bool:
    """True for the path that `-` means, in the spelling of any system."""
    return path == Path(STANDARD_INPUT)


def standard_input() -> BufferedReader:
    """The bytes of standard input. Raises CallError if the caller has closed it."""
    import sys

    if sys.stdin is None:
        raise CallError("standard input: is closed; name a file, or give it a pipe")
    return cast("BufferedReader", sys.stdin.buffer)


def check_seconds(option: str, value: float, low: float) -> None:
    """Raise CallError unless the value of an option is a time from `low` to LONGEST_S seconds."""
    if not low <= value <= LONGEST_S:  # false for nan, too
        raise CallError(f"{option} {value:g}: must be a time from {low:g} to {LONGEST_S:g} s", option=True)


def check_writable(*paths: Path | None, kept: Sequence[Path | None] = ()) -> None:
    """Raise CallError if a path cannot be written, or is a file that the call needs (`kept`)."""
    import os

    def real(path: Path) -> Path:
        return Path(os.path.realpath(path))  # of links in a circle, too, which can be neither read nor written

    taken = {real(path) for path in kept if path is not None}
    # the file of a stream may lie where this user cannot look
    streams = {real(Path(stream)): name for stream, name in STREAMS.items() if os.path.isfile(stream)}
    for path in paths:
        if path is None:
            continue
        if is_standard_input(path):
            raise CallError("-: is standard input; name a file for what is written")
        if real(path) in streams:
            raise CallError(f"{path}: is {streams[real(path)]} of this call; name another file for what is written")
        if path.is_dir():
            raise CallError(f"{path}: is a folder, not a file")
        if (path.is_file() or not path.exists()) and not os.access(path.parent, os.W_OK):
            raise CallError(f"{path}: cannot write in folder {path.parent}; choose another place")
        if real(path) in taken and not path.is_char_device():
            raise CallError(f"{path}: is named twice in this call; choose another name for what is written")
        taken.add(real(path))


def token(file: Path | None) -> str | None:
    """The first line of a file, else of the environment (bridge/23). Raises CallError."""
    import os

    if file is None:
        return os.environ.get(TOKEN, "").strip() or None
    with call_errors(file), open(file, encoding="utf-8") as opened:
        found = opened.readline(TOKEN_CHARACTERS).strip()
    if not found:
        raise CallError(f"{file}: holds no token in its first line")
    return found


def check_workers(workers: int) -> None:
    """Raise CallError unless it is a number of processes."""
    if workers < 1:
        raise CallError(f"workers {workers}: must be a number of processes from 1", option=True)


def crew_of(workers: int, address: str | None = None) -> Crew:
    """A crew ready to play jobs: `workers` processes of this computer, 1: this process; or the cluster at an address.
    Raises CallError for an address that cannot be one."""
    from isel_twin.base.crew import cluster, local

    return local(workers, preload=("isel_twin.jobs.ready",)) if address is None else cluster(address)


def check_one_crew(workers: int | None, cluster: str | None) -> None:
    """Raise CallError if both are named. workers: None unless named."""
    if workers is not None and cluster is not None:
        raise CallError("workers and cluster: a cluster has its own workers; name one of the two", option=True)


def parse_places(option: str, text: str, example: str) -> tuple[float, float, float]:
    """X, Y and Z of an option, mm. Raises CallError."""
    try:
        places = tuple(float(word) for word in text.split(","))
    except ValueError:
        places = ()
    if len(places) != 3 or not all(abs(mm) <= MOST_MM for mm in places):
        raise CallError(f"{option} {text!r}: must be X,Y,Z in mm, for example {example}", option=True)
    return places[0], places[1], places[2]


def parse_overrides(texts: Iterable[str]) -> dict[str, Any]:
    """Machine parameters from `--set`. Raises CallError."""
    return dict(parse_override(text) for text in texts)


def parse_override(text: str) -> tuple[str, Any]:
    """A machine parameter as KEY=VALUE; the value a number, true, false or a word. Raises CallError."""
    key, equals, word = (part.strip() for part in text.partition("="))
    if not equals or not key or not word:
        raise CallError(f"set {text!r}: must be KEY=VALUE, for example axes.all.steps_per_rev=3200", option=True)
    if word in ("true", "false"):
        return key, word == "true"
    for number in (int, float):
        try:
            return key, number(word)
        except ValueError:
            continue
    return key, word
