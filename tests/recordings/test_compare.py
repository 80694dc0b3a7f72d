"""Two recordings laid over each other: what is told of them, by sessions that differ in one known thing."""

from __future__ import annotations

import json
import random
import re
from pathlib import Path
from typing import Any

import pytest

from isel_twin.core.twin import Twin
from isel_twin.language import create_language, needed
from isel_twin.recordings.compare import Counters, _matched, exchanges
from isel_twin.recordings.judging import Comparison, Limits, compare
from isel_twin.recordings.mcap import RecordingWriter
from isel_twin.recordings.reading import Played, read
from isel_twin.recordings.recording import FileRecording
from tests.in_process import isel_twin as cli

BYTE_NS = 520_833
COMMANDS = ("@07", "@0R7", "@0A800,2000,400,2000,0,30,0,30", "@0P", "@0X")


def tapped(path: Path, *exchanged: tuple[float, bytes, float, bytes]) -> Path:
    """A recording of a real controller: time in s and bytes of each command, and of its reply."""
    with RecordingWriter(path, {"kind": "tap", "controller": "imc-s8"}) as writer:
        for sent_s, command, replied_s, reply in exchanged:
            writer.sent(round(sent_s * 1e9), command)
            if reply:
                writer.received(round(replied_s * 1e9), reply)
    return path


def of_twin(path: Path, commands: tuple[str, ...] = COMMANDS, **how: Any) -> Path:
    twin = Twin(plant="kinematic", **{"start_mm": (2.0, 2.0, 2.0), "line_speed": True, **how})
    recording = FileRecording(path, twin, 10_000_000)
    for command in commands:
        twin.query(command)
        twin.run(0.1)
    recording.close()
    return path


def laid_over(a: Path, b: Path, tolerance_s: float = 0.001) -> Comparison:
    languages = [needed(create_language("imc-s8"), "imc-s8") for _ in range(2)]
    return compare(read(a), read(b), *languages, Limits(round(tolerance_s * 1e9)))


def test_a_recording_is_the_same_as_itself(tmp_path: Path) -> None:
    path = of_twin(tmp_path / "a.mcap")
    result = laid_over(path, path, 0.0)
    assert result.same
    assert [pair.a.text for pair in result.pairs] == list(COMMANDS)
    assert [pair.a.reply for pair in result.pairs] == [b"0", b"0", b"0", b"0000320000190000000", b"5"]


def test_durations_are_from_the_last_byte_of_the_command_to_that_of_the_reply(tmp_path: Path) -> None:
    """`@0P` + CR: 4 bytes on the line, 19 bytes back, each 10 bits at 19200 baud."""
    recorded = read(of_twin(tmp_path / "a.mcap"))
    found = exchanges(recorded, needed(create_language("imc-s8"), "imc-s8"))
    position = found[3]
    assert position.duration_ns is not None
    assert position.duration_ns == pytest.approx((4 + 19) * BYTE_NS, rel=1e-4)
    assert position.counts == (800, 400, 0, 0)
    assert found[2].counts == (800, 400, 0, 0)


def test_counters_are_those_of_the_controller_at_any_time(tmp_path: Path) -> None:
    recorded = read(of_twin(tmp_path / "a.mcap"))
    counters, played = Counters(recorded), Played(recorded)
    looks = 0
    for piece in played.samples():
        for sample in piece:
            looks += 1
            assert counters.at(int(sample["time_ns"])) == tuple(sample["counts"].tolist())
    assert looks > 300


def test_another_reply_and_another_duration_are_told(tmp_path: Path) -> None:
    a = tapped(tmp_path / "a.mcap", (0, b"@07\r", 0.01, b"0"), (1, b"@0R7\r", 19.3, b"0"), (20, b"@0X\r", 20.1, b"5"))
    b = tapped(tmp_path / "b.mcap", (0, b"@07\r", 0.0105, b"0"), (3, b"@0R7\r", 21.5, b"0"), (30, b"@0X\r", 30.1, b"1"))
    result = laid_over(a, b)
    assert [(pair.number, result.differs(pair)) for pair in result.different] == [
        (2, ("start",)),
        (3, ("reply",)),
    ]
    assert result.most is not None
    assert result.most.number == 2
    assert result.most.later_ns == pytest.approx(200_000_000, abs=10)
    assert laid_over(a, b, 0.3).different[0].number == 3


def test_commands_that_only_one_side_has_are_told_and_the_rest_is_compared(tmp_path: Path) -> None:
    a = tapped(tmp_path / "a.mcap", *[(t, f"@0d{t}\r".encode(), t + 0.01, b"0") for t in range(10)])
    b = tapped(
        tmp_path / "b.mcap", *[(t, f"@0d{t}\r".encode(), t + 0.01, b"0") for t in (0, 1, 3, 4, 77, 5, 6, 7, 8, 9)]
    )
    result = laid_over(a, b)
    assert [exchange.text for exchange in result.only_a] == ["@0d2"]
    assert [exchange.text for exchange in result.only_b] == ["@0d77"]
    assert (len(result.pairs), result.different) == (9, ())
    assert not result.same


def test_a_missing_reply_is_a_difference(tmp_path: Path) -> None:
    a = tapped(tmp_path / "a.mcap", (0, b"@07\r", 0.01, b"0"))
    b = tapped(tmp_path / "b.mcap", (0, b"@07\r", 0.01, b""))
    result = laid_over(a, b)
    (pair,) = result.different
    assert result.differs(pair) == ("reply",)
    assert pair.later_ns is None


def test_bytes_in_pieces_are_the_same_commands(tmp_path: Path) -> None:
    whole = tapped(tmp_path / "a.mcap", (0, b"@07\r", 0.5, b"0"), (1, b"@0P\r", 1.5, b"0000320000190000000"))
    path = tmp_path / "b.mcap"
    with RecordingWriter(path, {"kind": "tap"}) as writer:
        for start_s, command, reply in ((0.1, b"@07\r", b"0"), (1.1, b"@0P\r", b"0000320000190000000")):
            for number, byte in enumerate(command):
                writer.sent(round(start_s * 1e9) - len(command) + 1 + number, bytes([byte]))
            for number, byte in enumerate(reply):
                writer.received(round((start_s + 0.5) * 1e9) - len(reply) + 1 + number, bytes([byte]))
    assert laid_over(whole, path, 0.0).same


@pytest.mark.parametrize("seed", range(20))
def test_matched_stretches_cover_both_sides_once(seed: int) -> None:
    """Every command stands in one stretch, in order, and stretches of the same commands are the same."""
    draw = random.Random(seed)
    a = [bytes([draw.randrange(4)]) for _ in range(draw.randrange(30))]
    b = [byte for byte in a if draw.random() < 0.8] + [b"x"] * draw.randrange(3)
    at_a = at_b = 0
    for first_a, last_a, first_b, last_b, alike in _matched(a, b):
        assert (first_a, first_b) == (at_a, at_b)
        at_a, at_b = last_a, last_b
        assert not alike or a[first_a:last_a] == b[first_b:last_b]
    assert (at_a, at_b) == (len(a), len(b))


def test_the_table_says_what_differs_first_and_most(tmp_path: Path) -> None:
    a, b = of_twin(tmp_path / "a.mcap"), of_twin(tmp_path / "b.mcap", start_mm=(3.0, 2.0, 2.0))
    done = cli("compare", a, b, "--time-tolerance", "0.1", "--no-explain")
    assert done.returncode == 1, done.stderr
    assert "first difference: command 2, @0R7: start" in done.stdout
    assert "largest time difference: command 2, @0R7: +" in done.stdout
    assert re.search(r"command 2 at 0\.\d{3} s, @0R7: start, first reference run \d+\.\d ms later on B", done.stdout)
    assert done.stdout.splitlines()[-1] == "not the same: 5 commands compared, 1 differ"
    done = cli("compare", a, b)
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1].startswith("the same but for the place at power-on, ")
    assert cli("compare", a, b, "--time-tolerance", "3").returncode == 0
    rows = [json.loads(line) for line in cli("compare", a, b, "--json", "--all").stdout.splitlines()]
    assert [row["command"] for row in rows[:-1]] == list(COMMANDS)
    assert (rows[-1]["same"], rows[-1]["first"]) == (False, 2)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("a.mcap", "none.mcap"), "there is no such file"),
        (("a.mcap", "text.txt"), "is no recording of isel-twin"),
        (("a.mcap", "tap.mcap"), "does not say which controller it is of; --controller NAME does"),
        (("a.mcap", "tap.mcap", "--controller", "abc"), "unknown controller 'abc'"),
        (("a.mcap", "a.mcap", "--time-tolerance", "-1"), "--time-tolerance -1: must be a time"),
    ],
)
def test_what_cannot_be_compared_is_refused_in_one_line(tmp_path: Path, arguments: tuple[str, ...], told: str) -> None:
    of_twin(tmp_path / "a.mcap", ("@07",))
    (tmp_path / "text.txt").write_text("hello")
    RecordingWriter(tmp_path / "tap.mcap", {"kind": "tap"}).close()
    done = cli("compare", *(tmp_path / name if "." in name else name for name in arguments))
    assert done.returncode == 2
    assert told in done.stderr
    assert len(done.stderr.splitlines()) == 1
