"""Pictures: of the size wanted, of the machine where it stands; or one line that says what is missing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin.machine import load_machine, machine_names
from isel_twin.plant.model import load_model
from isel_twin.plant.picture import Picture, draw, on_table

pytestmark = pytest.mark.long(seconds=6)

IMAGES = Path(__file__).parents[2] / "docs" / "images"


def drawn(make: Callable[[], NDArray[np.uint8]]) -> NDArray[np.uint8] | None:
    """A picture; None, and one clear line, on a computer without OpenGL."""
    try:
        return make()
    except RuntimeError as error:
        said = str(error)
    assert said.startswith("no picture without OpenGL: ")
    assert "\n" not in said
    return None


@pytest.mark.parametrize("name", machine_names())
def test_a_picture_shows_the_machine_where_it_stands(name: str) -> None:
    machine = load_machine(name)

    def two() -> NDArray[np.uint8]:
        with Picture(machine, height=300, width=400) as picture:
            return np.stack([picture.draw(place_mm) for place_mm in ((10.0, 10.0, 10.0), (250.0, 200.0, 100.0))])

    both = drawn(two)
    if both is not None:
        here, there = both
        assert both.shape == (2, 300, 400, 3)
        assert both.dtype == np.uint8
        assert here.std() > 10.0, "not an empty picture"
        assert (here != there).any(axis=2).mean() > 0.02, "the machine has moved"


def test_the_picture_of_the_docs_is_the_machine_of_today() -> None:
    """Drawn at (150, 100, 50) mm. Drivers differ in the last bits of a colour and at edges, nothing more."""
    from matplotlib import image

    kept = np.rint(255.0 * image.imread(IMAGES / "4030.png")[..., :3])
    now = drawn(lambda: draw(load_machine("4030"), (150.0, 100.0, 50.0), height=900, width=1200, camera="front"))
    if now is not None:
        assert now.shape == kept.shape
        assert (np.abs(now - kept).max(axis=2) > 30.0).mean() < 0.02


def test_many_pictures_with_one_renderer() -> None:
    def twice() -> NDArray[np.uint8]:
        with Picture(load_machine("4030")) as picture:
            first, between, again = (picture.draw((x, 0.0, 0.0)) for x in (0.0, 300.0, 0.0))
        assert first.shape == (480, 640, 3)
        assert (first == again).all()
        assert (first != between).any()
        return first

    drawn(twice)


def test_a_camera_that_does_not_exist_is_named() -> None:
    with pytest.raises(ValueError, match="unknown camera 'back'; there are: front"):
        draw(load_machine("4030"), (0.0, 0.0, 0.0), camera="back")


def test_a_path_lies_where_the_tool_goes_over_the_table() -> None:
    """Wherever the machine stands, the point of the path that it stands at is at the tool's tip."""
    for name in machine_names():
        machine = load_machine(name)
        model = load_model(machine)
        data = mujoco.MjData(model)
        axes = [axis.name for axis in machine.axes]
        path_mm = np.array([(10.0, 20.0, 5.0), (30.0, 20.0, 15.0), (30.0, 60.0, 15.0)])
        line = on_table(model, axes, path_mm)
        assert line.shape == (3, 3)
        for place_mm, drawn in zip(path_mm, line, strict=True):
            for axis, mm in zip(axes, place_mm, strict=True):
                data.joint(axis).qpos[0] = 1e-3 * mm
            mujoco.mj_forward(model, data)
            np.testing.assert_allclose(data.site("table_top").xpos + drawn, data.site("tool").xpos, atol=1e-12)
