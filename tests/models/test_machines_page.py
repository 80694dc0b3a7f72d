"""docs/machines.md is true: its machine is read, described and run as the page says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from isel_twin import Twin
from isel_twin.cli import main
from isel_twin.machine import MachineError, load_machine
from isel_twin.plant.model import load_model

from ..crashes.stl import write_stl

PAGE = (Path(__file__).parents[2] / "docs" / "machines.md").read_text(encoding="utf-8")


@pytest.fixture
def shop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folders with the page's machines: `shop`, `mill`, and one with its fixtures, `clamped`; the working directory is
    above them. The first of them."""
    files = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL)
    for name, file in zip(("shop", "mill", "clamped"), files, strict=True):
        (tmp_path / name).mkdir()
        head = 'based_on = "4030"\nname = "clamped"\n' if name == "clamped" else ""
        (tmp_path / name / "machine.toml").write_text(head + file, encoding="utf-8")
    write_stl(tmp_path / "clamped" / "clamp.stl", (30.0, 10.0, 8.0))
    folder = tmp_path / "shop"
    (tmp_path / "job.txt").write_text("@07\n@0R7\n@0A 1600,2000,0,900,0,900,0,900\n")
    monkeypatch.chdir(tmp_path)
    return folder


def test_what_it_says_holds(shop: Path) -> None:
    machine, like = load_machine(shop), load_machine("4030")
    x, _, z = machine.axes
    assert [axis.steps_per_mm for axis in machine.axes] == [160.0] * 3
    assert (x.stage.supply_v, x.stage.current_a, x.stage.idle_current_fraction) == (36.0, 2.8, 0.5)
    assert (x.motor.resistance_ohm, x.motor.torque_constant_nm_per_a) == (0.9, 0.316)
    assert (x.brake_n, z.brake_n, machine.payload_kg) == (0.0, 150.0, 5.0)
    assert {c.name: c.position_mm for c in machine.switches}["limit_x2"] == 380.0
    assert machine.controller["program_memory_bytes"] == 8192
    assert (machine.masses_kg, machine.structure) == (like.masses_kg, like.structure)


def test_its_servo_machine_is_one(shop: Path) -> None:
    x = load_machine(shop.parent / "mill").axes[0]
    assert x.closed_loop
    assert (x.motor.resistance_ohm, x.motor.torque_constant_nm_per_a) == (1.1, 0.12)
    assert (x.stage.position_gain_per_s, x.stage.lag_limit, x.stage.increments_per_rev) == (25.0, 8000.0, 5000)


def test_its_fixtures_stand_on_a_table(shop: Path) -> None:
    machine = load_machine(shop.parent / "clamped")
    names = [fixture.name for fixture in machine.fixtures]
    assert names == ["vise_jaw_left", "clamp", "plate", "blank", "length"]
    model = load_model(machine)
    assert [model.geom(f"fixture/{name}").name.partition("/")[2] for name in names] == names
    assert Twin(machine=machine, plant="kinematic").collisions == []


@pytest.mark.parametrize("line", re.findall(r"^    isel-twin (.*?)(?: +#.*)?$", PAGE, flags=re.MULTILINE))
def test_its_commands_work(shop: Path, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(line.split())
    said = capsys.readouterr()
    assert (caught.value.code, said.err) == (0, "")
    expected = {"describe": "bathroom scales", "motor": "rpm", "run": "all well: 3 commands"}
    assert expected[line.split()[0]] in said.out


def test_ten_millimetres_of_lead_make_ten_millimetres_a_revolution(shop: Path) -> None:
    twin = Twin(machine=str(shop), plant="kinematic")
    assert [twin.query(line) for line in ("@07", "@0R7", "@0A1600,2000,0,900,0,900,0,900")] == ["0"] * 3
    assert twin.position_mm[0] == pytest.approx(10.0, abs=0.05)  # play and switch scatter


def test_a_key_that_is_wrong_is_named_with_what_is_allowed(shop: Path) -> None:
    file = shop / "machine.toml"
    file.write_text(file.read_text().replace('unit = "kg"', 'unit = "g"'))
    with pytest.raises(MachineError, match=r"machine.toml: payload.mass: unit 'g'; allowed: 'kg'"):
        load_machine(shop)


def test_tables_of_a_file_are_those_of_the_page(shop: Path) -> None:
    named = set(re.findall(r"`\[(\w+)", PAGE))
    assert set(load_machine(shop).tree) - {"name", "description", "kinematics", "cabinet", "model", "fixture"} <= named
