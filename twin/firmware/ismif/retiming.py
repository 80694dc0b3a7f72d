"""Change the settings in a job: start speed, end speeds and ramp length before its vectors.

    #E1,1200      -->  #E1,3000       a line that sets one gets the value of the next vector that takes it
    L1,X1600      -->  #S300          others are set before the vector
                       #R10
                       L1,X1600       end speeds from `rapid_hz` upwards; slower ones are feeds

All are stored in the job and hold until set again (5.2), so a vector with the settings of the one before gets no extra
line. They are set again after `@R` and after a line with <...> other than 01h. A ramp is set by its length, rounded up
as in `move` (ismif/5): it is never steeper than wanted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from isel_twin.firmware.ismif.commands import CommandError, Instruction, parse
from isel_twin.firmware.ismif.configuration import Configuration
from isel_twin.language import SETTINGS_RANGES, JobMove, MoveSettings

STARTS = "<1>"  # ends the line that starts what has been stored
STEEPEST_HZ_PER_MS = SETTINGS_RANGES["acceleration_hz_per_ms"][1]


def defaults() -> Mapping[str, int]:
    """Of the factory (5.2): 200 Hz, and the ramp of 500 ms to 600 Hz."""
    factory = Configuration()
    return {
        "acceleration_hz_per_ms": _acceleration(factory.speed_hz[0], factory.start_hz, factory.ramp_ms),
        "start_stop_hz": factory.start_hz,
    }


def job_moves(lines: Sequence[str]) -> list[JobMove]:
    """The vectors, with what is in force there; a factory's interface at the beginning."""
    settings, found = Configuration(), []
    for number, told in enumerate(_told(lines)):
        if told is None:
            settings = Configuration()
        elif told.code == "L":
            speed_hz = settings.speed_hz[told.arguments[0]]
            acceleration = _acceleration(speed_hz, settings.start_hz, settings.ramp_ms)
            found.append(JobMove(number, (speed_hz,), acceleration, settings.start_hz))
        else:
            settings.set(told)
    return found


def retimed(lines: Sequence[str], settings: Mapping[int, MoveSettings], rapid_hz: int) -> list[list[str]]:
    """The replacement of each line."""
    told = list(_told(lines))
    wanted = _wanted(told, settings, rapid_hz)
    in_force: dict[str, str] = {}
    made = []
    for number, (line, instruction) in enumerate(zip(lines, told, strict=True)):
        own = [line]
        if instruction is None:
            in_force.clear()
        elif (key := _key(instruction)) is not None:
            own = [next((of[key] for at, of in wanted.items() if at > number and key in of), line)]
            in_force[key] = own[0]
        elif number in wanted:
            before = [text for key, text in wanted[number].items() if in_force.get(key) != text]
            in_force.update(wanted[number])
            own = [*before, line]
        made.append(own)
    return made


def faster(lines: Sequence[str], factor: float) -> list[str]:
    """The lines with all end speeds that they set times a factor; ramps keep their length. A controller refuses speeds
    beyond its range."""
    made = []
    for line, told in zip(lines, _told(lines), strict=True):
        if told is not None and told.code == "#E":
            index, speed_hz = told.arguments
            line = f"#E{index},{round(speed_hz * factor)}"
        made.append(line)
    return made


def _wanted(
    told: Sequence[Instruction | None], settings: Mapping[int, MoveSettings], rapid_hz: int
) -> dict[int, dict[str, str]]:
    """The lines that set what each vector is to have, by what they set."""
    own, found = Configuration(), {}
    for number, instruction in enumerate(told):
        if instruction is None:
            own = Configuration()
        elif instruction.code != "L":
            own.set(instruction)
        elif number in settings:
            index, asked = instruction.arguments[0], settings[number]
            speed_hz = asked.speed_hz if own.speed_hz[index] >= rapid_hz else own.speed_hz[index]
            start_hz = asked.start_stop_hz
            ramp_ms = max(0, -(-(speed_hz - start_hz) // asked.acceleration_hz_per_ms))
            found[number] = {"#S": f"#S{start_hz}", f"#E{index}": f"#E{index},{speed_hz}", "#R": f"#R{ramp_ms}"}
    return found


def _key(instruction: Instruction) -> str | None:
    """What a line sets: `#S`, `#R`, or `#E1` for the entry of a table; None: nothing of these."""
    if instruction.code == "#E":
        return f"#E{instruction.arguments[0]}"
    return instruction.code if instruction.code in ("#S", "#R") else None


def _acceleration(speed_hz: int, start_hz: int, ramp_ms: int) -> int:
    """In Hz/ms, as a whole number."""
    if speed_hz <= start_hz or ramp_ms == 0:
        return STEEPEST_HZ_PER_MS
    return min(max(1, round((speed_hz - start_hz) / ramp_ms)), STEEPEST_HZ_PER_MS)


NOTHING = Instruction("")  # a line that sets nothing and moves nothing


def _told(lines: Sequence[str]) -> Iterator[Instruction | None]:
    """Each line read; None: all settings may be others after it."""
    for line in lines:
        text = line.strip().removesuffix(STARTS)
        if "<" in text and not text.endswith("s>"):
            yield None
            continue
        try:
            instruction = parse(text.encode("latin-1"))
        except (CommandError, ValueError):
            instruction = NOTHING
        yield None if instruction.code == "@R" else instruction
