"""The picture of a failing test: a file of the right kind, also of a machine that has hardly moved."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin.core.twin import Twin
from isel_twin.recordings.recorder import Recorder


@pytest.mark.parametrize("commands", [(), ("@07",), ("@07", "@0R7", "@0M3200,4000,0,30,0,30,0,30")])
def test_a_picture_of_whatever_was_recorded(commands: tuple[str, ...], tmp_path: Path) -> None:
    from isel_twin.report.sketch import write_sketch

    twin = Twin(plant="kinematic", start_mm=(5.0, 5.0, 5.0))
    with Recorder(twin, 10_000_000) as recorder:
        for command in commands:
            twin.query(command)
        for number, zero_ns in enumerate((0, twin.time_ns, twin.time_ns + 1)):  # the last one: there is no path at all
            path = tmp_path / f"{number}.png"
            write_sketch(path, twin, recorder, zero_ns)
            assert path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


def test_a_folder_that_is_not_there_is_an_error_of_the_system(tmp_path: Path) -> None:
    from isel_twin.report.sketch import write_sketch

    twin = Twin(plant="kinematic")
    with Recorder(twin, 10_000_000) as recorder, pytest.raises(FileNotFoundError):
        write_sketch(tmp_path / "none" / "a.png", twin, recorder)
