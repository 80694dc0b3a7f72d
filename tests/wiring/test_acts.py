"""The table of everything an event can do, and the page that shows it."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

import pytest

from isel_twin.cli.ctl import Command
from isel_twin.machine import load_machine
from isel_twin.wiring import ACTS, EVENT_KEYS, Act, load_scenario, outputs, settable

PAGE = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text(encoding="utf-8")
MACHINE = load_machine("4030")


def row(act: Act) -> str:
    by = f"by {act.by}: " if act.by else ""
    if act.key == "set":
        end = "`ok`, or another state"
    else:
        shown = {"": '`""`', "off": '`"off"`', False: "`false`", None: "at once"}
        end = shown.get(act.off, "`0`") if not isinstance(act.off, float) else "`0`"
    return f"| `{act.key}` | {by}{act.allowed} | {act.meaning} | {end} |"


@pytest.mark.parametrize("act", ACTS.values(), ids=list(ACTS))
def test_the_page_has_the_row_of_each(act: Act) -> None:
    assert row(act) in PAGE.replace("100000", "100000")


@pytest.mark.parametrize("act", ACTS.values(), ids=list(ACTS))
def test_the_page_says_by_which_rules_each_is_told(act: Act) -> None:
    alike = ", ".join(f"`{other.key}`" for other in ACTS.values() if set(other.told) == set(act.told))
    (told,) = (line for line in PAGE.splitlines() if re.match(rf"\| [^|]*`{act.key}`[^|]* \| `[a-z]+`[^|]*\|$", line))
    names, rules = (re.findall("`([a-z_]+)`", cell) for cell in told.split("|")[1:3])
    assert (sorted(names), rules) == (sorted(re.findall("`([a-z_]+)`", alike)), list(act.told))


def test_keys_are_unique_and_every_one_is_a_command_of_the_shell() -> None:
    assert len(set(EVENT_KEYS)) == len(EVENT_KEYS)
    assert set(ACTS) - {"cut"} <= set(Command.__args__)  # type: ignore[attr-defined]


def blocks() -> list[str]:
    """The pieces of scenario files on the page; a call that writes one, printed with its answer, is none."""
    found = re.findall(r"(?:^    .*\n|^\n)+", PAGE, re.MULTILINE)
    return [textwrap.dedent(block).strip() for block in found if re.search(r"^ +\[\[event\]\]", block, re.MULTILINE)]


def test_every_piece_of_the_page_can_be_read(tmp_path: Path) -> None:
    assert len(blocks()) == 3
    for number, text in enumerate(blocks()):
        file = tmp_path / f"{number}.toml"
        file.write_text(text, encoding="utf-8")
        assert load_scenario(file, settable(MACHINE), [s.name for s in MACHINE.switches], outputs(MACHINE))
