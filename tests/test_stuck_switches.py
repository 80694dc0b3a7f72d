"""A reference run onto a switch that does not answer: an end, a reply and one clear line."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from isel_twin import Twin
from isel_twin.cli import main

STUCK, BROKEN = "stuck_closed", "broken"
SAID = {
    ("imc-s8", STUCK): "limit_x1 has not been struck in 2097152 steps towards it",
    ("imc-s8", BROKEN): "limit_x1 is still struck 16000 steps away from it",
    ("ismif", STUCK): "the reference input has not gone low in 200000 half steps of the search",
    ("ismif", BROKEN): "the reference input has not gone high in 4000 half steps of the free run",
}
ASKED = {
    "imc-s8": ((b"@07\r", b"0"), (b"@0R1\r", b"2")),
    "ismif": ((b"$HX\x01", b"\r\x02\r"),),
}
"""Bytes to send, and the reply to each. The iSMIF's replies never tell of an error: its status does (6.2)."""


def stuck(folder: Path, contact_state: str) -> Path:
    file = folder / "scenario.toml"
    file.write_text(f'[[event]]\nat = 0.001\nset = {{ limit_x1 = "{contact_state}" }}\n')
    return file


@pytest.mark.parametrize(("controller", "state"), SAID)
def test_in_process(tmp_path: Path, caplog: pytest.LogCaptureFixture, controller: str, state: str) -> None:
    twin = Twin(plant="kinematic", controller=controller, scenario=stuck(tmp_path, state), start_mm=(30, 30, 30))
    twin.run(0.01)
    for command, reply in ASKED[controller]:
        twin.write(command)
        assert twin.run_until_idle(4000)
        assert twin.read() == reply
    assert controller != "ismif" or twin.fault
    [(time_ns, text)] = twin.remarks
    assert text == f"reference run of X: {SAID[controller, state]}"
    assert 0 < time_ns <= twin.time_ns
    [record] = [record for record in caplog.records if record.levelno >= logging.WARNING]
    assert record.getMessage() == f"at {time_ns / 1e9:.3f} s: {text}"


@pytest.mark.parametrize(("controller", "state"), SAID)
def test_on_the_shell(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    controller: str,
    state: str,
) -> None:
    job = tmp_path / "job.txt"
    sent = [command.decode().replace("\r", "").replace("\x01", "<1>") for command, _ in ASKED[controller]]
    job.write_text("\n".join(["<0.01s>", *sent]))
    call = ["run", str(job), "--plant", "kinematic", "--controller", controller]
    with pytest.raises(SystemExit) as caught:
        main([*call, "--scenario", str(stuck(tmp_path, state))])
    assert caught.value.code == 1
    assert "\nfailed: " in capsys.readouterr().out
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == 1
    assert said[0].endswith(f" s: reference run of X: {SAID[controller, state]}")
