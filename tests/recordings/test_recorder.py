"""A recording that has no room left ends, and the machine goes on."""

from __future__ import annotations

import numpy as np

from isel_twin.core.twin import Twin
from isel_twin.recordings.recorder import BUFFER, Recorder

MS = 1_000_000


def test_a_full_disk_ends_the_recording_not_the_machine(tmp_path, caplog):
    twin = Twin(plant="kinematic")
    (tmp_path / "full").touch()
    with open(tmp_path / "full", "rb") as full, Recorder(twin, 1 * MS) as recorder:
        recorder._file.close()
        recorder._file = full  # open for reading: nothing can be written to it, as on a full disk
        twin.run(2 * BUFFER * MS / 1e9)
        assert twin.query("@07") == "0"
        assert recorder.ended
        assert len(recorder) == BUFFER
        samples = np.concatenate(list(recorder.samples()))
    assert samples["time_ns"].tolist() == [number * MS for number in range(BUFFER)]
    assert caplog.text.count("the recording ends at 4.095 s") == 1


def test_a_closed_recorder_has_let_go_of_its_file():
    with Recorder(Twin(plant="kinematic"), 1 * MS) as recorder:
        assert not recorder._file.closed
    assert recorder._file.closed
