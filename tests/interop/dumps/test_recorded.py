"""What sigrok-cli 0.7.2, GTKWave 3.3.118 and pywellen 0.25.7 read in a dump (recorded.json), against what was made.

`python -m tests.interop.dumps` has them read it again.
"""

from __future__ import annotations

import json
from itertools import accumulate
from pathlib import Path

import pytest

from isel_twin.capture.load import load
from tests.interop.dumps import __main__ as command_line
from tests.interop.dumps.readers import MS, OPENED_NS, STEPS_NS, Changes, X, Y, by_pyvcd, written

RECORDED = json.loads(command_line.RECORDED.read_text())


def rises(changes: Changes, name: str) -> list[int]:
    return [time for time, value in changes[name] if value == "1" and time]


def test_the_dump_is_the_one_that_they_read(tmp_path: Path) -> None:
    written(tmp_path / "job.vcd")
    assert (tmp_path / "job.vcd").read_text() == RECORDED["dump"]


@pytest.mark.parametrize("reader", ["pyvcd", "gtkwave", "wellen"])
def test_it_is_read_whole(reader: str) -> None:
    changes = by_pyvcd(RECORDED["dump"])
    read: Changes = changes if reader == "pyvcd" else RECORDED[reader]
    assert read == changes
    assert rises(read, "step.step_x") == STEPS_NS
    assert rises(read, "step.step_y") == STEPS_NS[: sum(Y)]
    assert [float(value) for _, value in read["machine.count_x"]] == [0, *accumulate(X)]
    assert read["input.hood"] == [[0, "closed"], [OPENED_NS, "open"]]


def test_sigrok_has_every_edge() -> None:
    """A sample is 1 us; behind the opened hood, which is text, and behind changes of counters, which are numbers."""
    read = RECORDED["sigrok"]
    assert rises(read, "step_x") == [MS * (k + 1) for k in range(len(X))]
    assert rises(read, "step_y") == [MS * (k + 1) for k in range(sum(Y))]
    assert rises(read, "hood_changed") == [OPENED_NS]


def test_its_decoder_counts_them() -> None:
    """One behind: at each step it says where the one before went; dir is high for minus."""
    for axis, made in ("x", X), ("y", Y[: sum(Y)]):
        assert RECORDED["stepper_motor"][axis] == [-at for at in accumulate(made)][:-1]


def test_a_code_is_no_value_and_no_command() -> None:
    """Of values begin with one of these: 0 1 x z u w l h - b r s, of times and commands # and $ (IEEE 1364)."""
    codes = {line.split()[3] for line in RECORDED["dump"].splitlines() if line.startswith("$var")}
    assert not [code for code in codes if code[0].lower() in "01xzuwlh-brs#$"]


def test_a_program_missing_is_said_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("shutil.which", lambda name: None)
    assert command_line.main() == 2
    assert capsys.readouterr().out.count("\n") == 1


ICARUS = Path(__file__).parent / "icarus.vcd"
"""By Icarus Verilog 11: iverilog -o board.vvp icarus.v && vvp -n board.vvp. Five steps in +, three in $dumpoff, two
in -; step is x until its first pulse, and the unit is 1 ps."""


def test_what_icarus_writes_is_read() -> None:
    ticks = load(ICARUS)
    assert ticks.t_ns.tolist() == [*range(6_000, 50_000, 10_000), 86_000, 96_000]
    assert ticks.delta[:, 0].tolist() == [1] * 5 + [-1] * 2
    assert ticks.gaps == ((51_000, 81_000),)
