"""What outlives a server: flash image, recording; and what a bad end does to it."""

from __future__ import annotations

import signal

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.bridge.conftest import ask
from tests.forked import run
from tests.in_process import isel_twin

OLD, NEW = "first", "second"


def user_info(port) -> str:
    """`@0U`: 0, then the text with the user information in one line (4.2.16)."""
    port.write(b"@0U\r")
    return port.read_until(b"\n").decode()


def test_the_flash_outlives_the_server(serve, tmp_path):
    flash = tmp_path / "imc.flash"
    served = serve("--flash", str(flash))
    with served.open() as port:
        assert ask(port, f"@0IU{OLD}") == "0"
        assert ask(port, "@0IW") == "0"
    assert served.stop(signal.SIGTERM) == 0
    assert [file.name for file in tmp_path.iterdir()] == ["imc.flash"]
    with serve("--flash", str(flash)).open() as port:
        assert OLD in user_info(port)


def test_a_flash_file_is_there_from_the_start(serve, tmp_path):
    flash = tmp_path / "imc.flash"
    served = serve("--flash", str(flash))
    assert flash.exists()
    assert served.stop(signal.SIGTERM) == 0
    with serve("--flash", str(flash)).open() as port:
        assert ask(port, "@07") == "0"


@pytest.mark.parametrize("attempt", range(4))
def test_pulling_the_mains_leaves_the_old_or_the_new_flash(serve, tmp_path, attempt):
    """SIGKILL right after `@0IW` was sent, or after it was answered: the next start finds one or the other, whole."""
    flash = tmp_path / "imc.flash"
    served = serve("--flash", str(flash))
    with served.open() as port:
        assert ask(port, f"@0IU{OLD}") == "0"
        assert ask(port, "@0IW") == "0"
        assert ask(port, f"@0IU{NEW}") == "0"
        port.write(b"@0IW\r" * (attempt + 1))
        stored = port.read(attempt)
        served.stop(signal.SIGKILL)
    with serve("--flash", str(flash)).open() as port:
        info = user_info(port)
    assert NEW in info if stored else (OLD in info or NEW in info)


def test_a_damaged_flash_image_is_the_controllers_business(serve, tmp_path):
    """It starts with its defaults, and what is left of the image is not overwritten until something is stored."""
    flash = tmp_path / "imc.flash"
    flash.write_bytes(b"isel-twin imc flash 1 00000000\nhalf")
    served = serve("--flash", str(flash))
    with served.open() as port:
        assert ask(port, "@07") == "0"
        assert flash.read_bytes() == b"isel-twin imc flash 1 00000000\nhalf"
        assert ask(port, f"@0IU{NEW}") == "0"
        assert ask(port, "@0IW") == "0"
    assert served.stop(signal.SIGTERM) == 0
    with serve("--flash", str(flash)).open() as port:
        assert NEW in user_info(port)


def test_a_second_server_on_one_flash_file_is_refused_in_one_line(serve, tmp_path):
    flash = tmp_path / "imc.flash"
    served = serve("--flash", str(flash))
    second = run("serve", "--plant", "kinematic", "--flash", flash)
    assert second.returncode == 2
    assert second.stdout == ""
    (line,) = second.stderr.splitlines()
    assert f"imc.flash: is in use by another twin, in process {served.process.pid}" in line
    with served.open() as port:
        assert ask(port, "@07") == "0"


@pytest.mark.parametrize("file", ["/dev/zero", "."])
def test_a_flash_memory_is_a_regular_file(file):
    refused = isel_twin("serve", "--plant", "kinematic", "--flash", file)
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert "no regular file" in line or "is a folder" in line


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_recording_is_complete_when_the_server_has_stopped(serve, tmp_path, number):
    record = tmp_path / "session.npz"
    served = serve("--record", str(record), "--interval", "0.1")
    with served.open() as port:
        assert ask(port, "@07") == "0"
        assert ask(port, "@0R7") == "0"
        assert ask(port, "@0A 3200,5000,0,30,-0,30,0,30") == "0"
    assert served.stop(number) == 0
    with np.load(record) as stream:
        assert stream["delta"][-3200:].sum(axis=0).tolist() == [3200, 0, 0, 0]


def test_a_recording_of_samples(serve, tmp_path):
    record = tmp_path / "session.parquet"
    served = serve("--record", str(record), "--interval", "0.01")
    with served.open() as port:
        assert ask(port, "@07") == "0"
        assert ask(port, "@0R7") == "0"
    assert served.stop(signal.SIGTERM) == 0
    table = pq.read_table(record)
    assert table["count_x"][-1].as_py() == 0
    assert "struck" in table["input_limit_x1"].to_pylist()
