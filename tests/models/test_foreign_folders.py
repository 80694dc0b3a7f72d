"""A machine folder from anybody reads what lies below or beside it, and its model what lies in the model's folder."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from isel_twin.base.errors import CallError
from isel_twin.jobs import project
from isel_twin.machine import MachineError, load_machine, machine_from_tree
from isel_twin.many.identification.patch import based_on

MODEL = "<mujoco><worldbody/></mujoco>"
BOX = '[[fixture]]\nname = "clamp"\nshape = "mesh"\nat_mm = [0, 0, 0]\nfile = "{}"\n'


@pytest.fixture
def shop(tmp_path: Path) -> Path:
    """A machine folder with something above and something far beside it."""
    folder = tmp_path / "machines" / "shop"
    folder.mkdir(parents=True)
    for place in (tmp_path, tmp_path / "machines", folder):
        (place / "part.xml").write_text(MODEL)
        (place / "part.stl").write_bytes(b"")
    (tmp_path / "machine.toml").write_text('based_on = "4030"\n')
    return folder


def refusal(folder: Path, text: str) -> str:
    (folder / "machine.toml").write_text(text)
    with pytest.raises(MachineError) as caught:
        load_machine(folder)
    told = str(caught.value)
    assert "\n" not in told
    return told


@pytest.mark.parametrize(
    "name", ["{above}", "../..", "../../machine.toml", "~/machine", "C:/machine", "below/../../.."]
)
def test_a_machine_elsewhere_is_no_base(shop: Path, name: str) -> None:
    name = name.format(above=shop.parents[1].as_posix())
    told = refusal(shop, f'based_on = "{name}"\n')
    assert told.startswith(f"{shop / 'machine.toml'}: based_on: {name!r} lies elsewhere; allowed: a path below {shop}")


@pytest.mark.parametrize("key", ["model", "fixture"])
@pytest.mark.parametrize("name", ["{above}/part.xml", "../../part.xml", "/etc/passwd"])
def test_a_model_elsewhere_is_refused(shop: Path, key: str, name: str) -> None:
    name = name.format(above=shop.parents[1].as_posix())
    told = refusal(shop, f'based_on = "4030"\n{key} = "{name}"\n')
    assert f"{key}: {name!r} lies elsewhere" in told


@pytest.mark.parametrize("name", ["/etc/part.stl", "../../part.stl"])
def test_a_mesh_of_a_fixture_elsewhere_is_refused(shop: Path, name: str) -> None:
    assert f"fixture 1.file: {name!r} lies elsewhere" in refusal(shop, f'based_on = "4030"\n{BOX.format(name)}')


@pytest.mark.parametrize("name", ["/etc/part.stl", "../../part.stl", "~/part.stl", "C:/part.stl", "link.stl"])
def test_so_is_one_of_a_project(shop: Path, name: str) -> None:
    (shop / "link.stl").symlink_to(shop.parents[1] / "part.stl")
    (shop / project.FILE).write_text(BOX.format(name))
    with pytest.raises(project.SettingsError) as caught:
        project.fixtures(shop / project.FILE)
    assert f"fixture 1.file: {name!r} lies elsewhere; allowed: a path below {shop}, or beside it" in str(caught.value)


@pytest.mark.parametrize("name", ["part.stl", "../part.stl", "../beside/part.stl"])
def test_a_project_has_meshes_below_and_beside_it(shop: Path, name: str) -> None:
    (shop.parent / "beside").mkdir()
    (shop.parent / "beside" / "part.stl").write_bytes(b"")
    (shop / project.FILE).write_text(BOX.format(name))
    (one,) = project.fixtures(shop / project.FILE)
    assert one.file == shop / name


def test_a_link_that_leads_elsewhere_is_refused(shop: Path) -> None:
    (shop / "link.xml").symlink_to(shop.parents[1] / "part.xml")
    assert "fixture: 'link.xml' lies elsewhere" in refusal(shop, 'based_on = "4030"\nfixture = "link.xml"\n')
    (shop / "vise.xml").write_text('<mujoco><include file="link.xml"/></mujoco>')
    assert "'link.xml' lies elsewhere" in refusal(shop, 'based_on = "4030"\nfixture = "vise.xml"\n')


def test_what_lies_below_or_beside_is_read(shop: Path) -> None:
    (shop / "machine.toml").write_text('based_on = "4030"\nfixture = "../part.xml"\n')
    assert load_machine(shop).fixture_file is not None
    (shop / "below").mkdir()
    (shop / "below" / "machine.toml").write_text('based_on = ".."\n')
    assert load_machine(shop / "below").name == load_machine("4030").name
    (shop / "part.xml").write_text('<mujoco><compiler meshdir="m"/><include file="below/more.xml"/></mujoco>')
    (shop / "below" / "more.xml").write_text(MODEL)
    (shop / "machine.toml").write_text('based_on = "4030"\nfixture = "part.xml"\n')
    assert load_machine(shop).fixture_file == shop / "part.xml"


@pytest.mark.parametrize("key", ["model", "fixture"])
@pytest.mark.parametrize(
    ("content", "name"),
    [
        ('<include file="{}"/>', "../part.xml"),
        ('<include file="{}"/>', "/etc/passwd"),
        ('<asset><mesh file="{}"/></asset>', "../part.stl"),
        ('<asset><mesh file="{}"/></asset>', "..\\part.stl"),
        ('<asset><mesh file="{}"/></asset>', "C:\\part.stl"),
        ('<asset><texture type="2d" file="{}"/></asset>', "/etc/passwd"),
        ('<asset><texture type="cube" fileup="{}"/></asset>', "../part.png"),
        ('<asset><hfield name="h" file="{}"/></asset>', "../part.png"),
        ('<asset><model name="m" file="{}"/></asset>', "../part.xml"),
        ('<compiler meshdir="{}"/>', ".."),
        ('<compiler texturedir="{}"/>', "/etc"),
        ('<compiler assetdir="{}"/>', "sub/../.."),
    ],
)
def test_a_model_names_files_of_its_folder_only(shop: Path, key: str, content: str, name: str) -> None:
    (shop / "mine.xml").write_text(f"<mujoco>{content.format(name)}</mujoco>")
    told = refusal(shop, f'based_on = "4030"\n{key} = "mine.xml"\n')
    assert told == f"{shop / 'mine.xml'}: {name!r} lies elsewhere; allowed: files in {shop} and below"


def test_what_an_included_file_names_counts_too(shop: Path) -> None:
    (shop / "mine.xml").write_text('<mujoco><include file="more.xml"/></mujoco>')
    (shop / "more.xml").write_text('<mujoco><include file="../part.xml"/></mujoco>')
    assert refusal(shop, 'based_on = "4030"\nfixture = "mine.xml"\n').startswith(f"{shop / 'more.xml'}: '../part.xml'")


def test_a_file_that_includes_itself_is_refused(shop: Path) -> None:
    (shop / "mine.xml").write_text('<mujoco><include file="mine.xml"/></mujoco>')
    for key in ("model", "fixture"):
        told = refusal(shop, f'based_on = "4030"\n{key} = "mine.xml"\n')
        assert told == f"{shop / 'mine.xml'}: its includes do not end; allowed: 64 files, up to 8 in each other"


@pytest.mark.parametrize("depth", [6, 24])
def test_files_that_include_the_next_twice_are_bounded(shop: Path, depth: int) -> None:
    """2^24 files at the end, and 127 in the shallow one."""
    for n in range(depth):
        twice = f'<include file="{n + 1}.xml"/>' * 2
        (shop / f"{n}.xml").write_text(f"<mujoco>{twice}</mujoco>")
    (shop / f"{depth}.xml").write_text(MODEL)
    assert "its includes do not end" in refusal(shop, 'based_on = "4030"\nmodel = "0.xml"\n')


def test_the_machine_of_a_recording_is_held_to_the_same(shop: Path) -> None:
    (shop / "mine.xml").write_text('<mujoco><include file="mine.xml"/></mujoco>')
    tree = {**load_machine("4030").tree, "model": "mine.xml"}
    with pytest.raises(MachineError, match="its includes do not end"):
        machine_from_tree(tree, shop / "machine.toml")


def test_a_long_row_of_bases_is_refused(tmp_path: Path) -> None:
    for n in range(17):
        (tmp_path / str(n)).mkdir()
        base = "4030" if n == 16 else f"../{n + 1}"
        (tmp_path / str(n) / "machine.toml").write_text(f'based_on = "{base}"\n')
    assert load_machine(tmp_path / "2").name == load_machine("4030").name
    with pytest.raises(MachineError, match=re.escape("allowed: 16 machines, one based on the other")):
        load_machine(tmp_path / "0")


def test_names_that_cannot_be_are_refused_in_one_line(shop: Path) -> None:
    (shop / "loop.xml").symlink_to("loop.xml")
    for name in ("loop.xml", r"a\u0000b.xml"):
        assert "does not exist" in refusal(shop, f'based_on = "4030"\nfixture = "{name}"\n')
        assert "unknown machine" in refusal(shop, f'based_on = "{name}"\n')


def test_a_patch_lies_where_it_may_name_its_base(shop: Path) -> None:
    (shop / "machine.toml").write_text('based_on = "4030"\n')
    machine = load_machine(shop)
    assert based_on(str(shop), machine, shop.parent / "patch") == "../shop"
    with pytest.raises(CallError, match=f"must lie beside {re.escape(str(shop))}"):
        based_on(str(shop), machine, shop.parents[1] / "elsewhere" / "patch")
