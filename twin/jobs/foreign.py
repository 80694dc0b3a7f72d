"""Jobs and programs of another controller than the one they are given to: named, with what to type (jobs/3, jobs/12).

@07     given to an iSMIF   --->   line 1: '@07' is a command of c142, imc-m, imc-mp or imc-s8, not of ismif
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import islice

from isel_twin.controller import PluginError, offers
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.job import JobError, commands, expects
from isel_twin.language import (
    HasExample,
    KnowsCommands,
    Language,
    RunsPrograms,
    create_language,
    language_names,
    programs_for,
)

HEAD = 50  # commands by which a job is known
SHOWN = 40  # characters of a line that are quoted


def check_controller(text: str, language: Language | None, controller: str) -> None:
    """Raise JobError for a text that can only be a program or a job of other controllers, or a job of none."""
    check_others(text, language, controller)
    lines = _first(text)
    if not lines or not offers(language, KnowsCommands) or text.lstrip().startswith("#"):
        return
    if all(line.startswith((";", "(")) for _, line in lines):
        raise JobError("there are only remarks in it")
    if not offers(language, RunsPrograms) and not expects(text) and not any(language.knows(each) for _, each in lines):
        number, line = lines[0]
        others = ", nor is any other line" if len(lines) > 1 else ""
        raise JobError(
            f"line {number}: {line[:SHOWN]!r} is no command of {controller}{others}; a job of such lines begins with a "
            "remark (# ...)"
        )


def check_others(text: str, language: Language | None, controller: str) -> None:
    """Raise JobError for a text that can only be a program or a job of other controllers."""
    if not offers(language, RunsPrograms) and (others := programs_for(text)):
        raise JobError(
            f"is a program for {_any_of(others)}, which {controller} cannot run: {_to_type(others)}. A job begins with "
            "a command or a remark (# ...)"
        )
    if not offers(language, KnowsCommands):
        return
    lines = _first(text)
    if not lines or any(language.knows(line) for _, line in lines):
        return
    if others := [name for name in language_names() if name != controller and _knows_all(name, lines)]:
        number, line = lines[0]
        whose = f"is a command of {_any_of(others)}, not of {controller}: {_to_type(others)}"
        raise JobError(f"line {number}: {line[:SHOWN]!r} {whose}")


def _first(text: str) -> Sequence[tuple[int, str]]:
    """The first commands with the numbers of their lines; those in numbers of bytes may be for anyone."""
    return list(islice(_begun(text), HEAD))


def _begun(text: str) -> Iterator[tuple[int, str]]:
    for number, command in commands(text):
        if begun := command.partition("<")[0].strip():
            yield number, begun


def _knows_all(name: str, lines: Sequence[tuple[int, str]]) -> bool:
    """False for controllers that run programs: those are known by `programs_for`."""
    with suppress(PluginError):
        language = create_language(name)
        if offers(language, KnowsCommands) and not offers(language, RunsPrograms):
            return all(language.knows(line) for _, line in lines)
    return False


def _any_of(names: Sequence[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} or {last}" if others else last


def _to_type(names: Sequence[str]) -> str:
    usual = TwinSpec.controller if TwinSpec.controller in names else names[0]
    language = create_language(usual)
    machine = f" --machine {language.example().machine}" if offers(language, HasExample) else ""
    return f"--controller {usual}{machine}"
