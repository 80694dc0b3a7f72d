"""Machines of one's own at the command line: what is wrong with one is said when it is read, by every command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from isel_twin import Twin
from isel_twin.base.parameters import Limits
from isel_twin.cli import main
from isel_twin.controller import registry, takes
from isel_twin.machine import MachineError, load_machine

MOTOR = """
[axes.x]
motor = "mine"

[axes.x.stage]
supply = { value = 24.0, unit = "V", grade = "setting", source = "label of the supply" }

[motors.mine]
resistance_ohm = { value = 0.9, unit = "ohm", grade = "datasheet", source = "label" }
inductance_h = { value = 2.5e-3, unit = "H", grade = "datasheet", source = "label" }
torque_constant_nm_per_a = { value = 0.31, unit = "N m/A", grade = "datasheet", source = "holding torque" }
rotor_inertia_kgm2 = { value = 3e-5, unit = "kg m2", grade = "estimate", source = "motors of the same length" }
"""


@pytest.fixture
def call(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    """call(text, words...) -> exit code, standard output, standard error, with a machine of this text in {machine}."""

    def run(text: str, *words: str) -> tuple[int, str, str]:
        (tmp_path / "machine.toml").write_text(f'based_on = "4030"\nname = "mine"\n{text}', encoding="utf-8")
        (tmp_path / "job.txt").write_text("@07\n")
        with pytest.raises(SystemExit) as caught:
            main([word.format(machine=tmp_path) for word in words])
        assert isinstance(caught.value.code, int)
        return caught.value.code, *capsys.readouterr()

    return run


COMMANDS = [
    ("describe", "{machine}"),
    ("run", "{machine}/job.txt", "--machine", "{machine}", "--plant", "kinematic"),
    ("serve", "--machine", "{machine}", "--plant", "kinematic", "--tcp", "127.0.0.1:0"),
    ("motor", "23HS32-4004S", "--machine", "{machine}"),
]


@pytest.mark.parametrize("words", COMMANDS, ids=lambda words: words[0])
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[controller]\nprogram_memory_bites = 1", "controller.program_memory_bites: unknown key; did you mean"),
        ("[controller]\nprogram_memory_bytes = 0", "controller.program_memory_bytes: 0; allowed: 1 .. 1e+09"),
        ("[contacts.stop]\nterminal = 'p1.4'", "contacts.stop.terminal: terminals belong to the controller"),
        ("[axes.y]\nmotor = 'steam'", "axes.y.motor: 'steam'; allowed: 23HS32-4004S, "),
        (
            "[axes.z]\ntravel = { value = 150, unit = 'mm', grade = 'setting', source = 'longer' }",
            "axes.z.travel: 150 mm; allowed: up to 143 mm, where joint z ends in ",
        ),
    ],
    ids=["setting", "range", "terminal", "motor", "travel"],
)
def test_every_command_that_reads_a_machine_says_what_is_wrong_with_it(
    call: Any, tmp_path: Path, words: tuple[str, ...], text: str, said: str
) -> None:
    code, out, err = call(text, *words)
    assert (code, out, err.count("\n")) == (2, "", 1), err
    assert err.startswith(f"isel-twin: {tmp_path}/machine.toml: {said}")


def test_motors_of_a_machine_are_described_with_unit_grade_and_source(call: Any) -> None:
    code, out, _ = call(MOTOR, "describe", "{machine}")
    assert code == 0
    (line,) = [line for line in out.splitlines() if "motors.mine.rotor_inertia_kgm2" in line]
    assert line.split(maxsplit=4)[1:4] == ["3e-05", "kg", "m2"]
    assert "estimate" in line
    assert "motors of the same length" in line


def test_a_motor_of_a_machine_is_shown_on_its_stage(call: Any) -> None:
    code, out, _ = call(MOTOR, "motor", "mine", "--machine", "{machine}")
    assert code == 0
    assert out.splitlines()[0] == "mine at 24 V, 4.2 A peak (2.97 A RMS), 8 microsteps a full step, fast stage"
    assert out.splitlines()[1].startswith("R 0.9 ohm, L 2.5 mH, Km 0.310 Nm/A, J 3e-05 kg m^2")
    code, out, _ = call(MOTOR, "motor", "57HS56-2804", "--machine", "{machine}")
    assert (code, out.splitlines()[0]) == (
        0,
        "57HS56-2804 at 48 V, 2.8 A peak (1.98 A RMS), 8 microsteps a full step, fast stage",
    )


def test_a_motor_that_the_machine_does_not_have_is_named(call: Any) -> None:
    code, out, err = call(MOTOR, "motor", "yours", "--machine", "{machine}")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "unknown motor 'yours'; there are: 23HS32-4004S, " in err
    assert err.endswith(", mine\n")


@takes({"gain": Limits("", 0.0, 1.0), "mode": ("slow", "fast"), "echo": bool, "greeting": ()})
def create(name: str, *, flash: bytes | None, settings: Any) -> Any:
    from isel_twin.firmware.imc import create as imc

    told.append(dict(settings))
    return imc("imc-s8", flash=flash, settings={})


told: list[dict[str, Any]] = []


@pytest.fixture
def other(monkeypatch: pytest.MonkeyPatch) -> None:
    """A controller of somebody else's, with settings of all kinds; it is this module's `create`."""
    metadata = registry.importlib.metadata
    entry = metadata.EntryPoint("other", f"{__name__}:create", "isel_twin.controllers")
    installed = metadata.entry_points(group="isel_twin.controllers")
    monkeypatch.setattr(registry, "_settings", {})
    monkeypatch.setattr(metadata, "entry_points", lambda: metadata.EntryPoints([*installed, entry]))


@pytest.mark.usefixtures("other")
def test_settings_of_other_controllers_are_theirs_to_tell(tmp_path: Path) -> None:
    file = tmp_path / "machine.toml"
    given = "gain = 0.5\nmode = 'fast'\necho = true\ngreeting = 'hello'\nprogram_memory_bytes = 4096\n"
    file.write_text(f"based_on = '4030'\n[controller]\n{given}")
    Twin(file, "other", "kinematic")
    assert told[-1] == {
        "gain": 0.5, "mode": "fast", "echo": True, "greeting": "hello", "program_memory_bytes": 4096
    }  # fmt: skip
    for line, said in {
        "gain = 1.5": "gain: 1.5; allowed: 0 .. 1",
        "mode = 'medium'": "mode: 'medium'; allowed: slow, fast",
        "echo = 1": "echo: 1; allowed: true, false",
        "greeting = 3": "greeting: 3; allowed: text",
    }.items():
        file.write_text(f"based_on = '4030'\n[controller]\n{line}\n")
        with pytest.raises(MachineError, match="controller") as error:
            load_machine(file)
        assert str(error.value) == f"{file}: controller.{said}"
