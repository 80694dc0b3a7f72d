"""Files appear whole or not at all, whenever the power fails."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import subprocess
import sys
import threading

import pytest

from isel_twin.base.files import Claim, atomic_write, replacing
from isel_twin.core.flash import FLASH_BYTES, FlashFile, flash_file
from tests.forked import PATIENCE_S


class PowerCut(BaseException):
    """The process ends here."""


def test_a_file_is_written_and_replaced(tmp_path):
    path = tmp_path / "file"
    atomic_write(path, b"old")
    atomic_write(path, b"new")
    assert path.read_bytes() == b"new"
    assert os.listdir(tmp_path) == ["file"]


@pytest.mark.parametrize("call", ["open", "fdopen", "fchmod", "fsync", "replace"])
@pytest.mark.parametrize("when", ["before", "after"])
def test_a_power_cut_at_any_step_leaves_the_old_or_the_new_file(tmp_path, monkeypatch, call, when):
    path = tmp_path / "file"
    old, new = b"old" * 1000, b"new" * 2000
    path.write_bytes(old)
    real = getattr(os, call)

    def cut(*arguments, **options):
        if when == "after":
            real(*arguments, **options)
        raise PowerCut

    monkeypatch.setattr(os, call, cut)
    with pytest.raises(PowerCut):
        atomic_write(path, new)
    monkeypatch.undo()
    assert path.read_bytes() in (old, new)


def test_an_error_while_writing_leaves_the_old_file_and_no_litter(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"old")

    def fail(file):
        file.write(b"half")
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), replacing(path) as file:
        fail(file)
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["file"]


def test_a_link_is_followed_and_permissions_stay(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_bytes(b"old")
    target.chmod(0o640)
    link.symlink_to(target)
    atomic_write(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"
    assert target.stat().st_mode & 0o777 == 0o640


def test_devices_are_written_to_not_replaced():
    atomic_write("/dev/null", b"gone")
    assert not os.path.isfile("/dev/null")


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(IsADirectoryError):
        atomic_write(tmp_path, b"")


class FlashTwin:
    """A twin's flash, as far as a flash file is concerned."""

    def __init__(self, flash: bytes | None) -> None:
        self.flash = flash
        self.on_flash = None


def test_a_flash_file_is_created_and_follows_the_flash(tmp_path):
    path = tmp_path / "flash"
    keeper = FlashFile(path)
    assert keeper.image is None
    twin = FlashTwin(None)
    keeper.attach(twin)
    assert path.read_bytes() == b""
    twin.on_flash(b"image")
    assert path.read_bytes() == b"image"
    keeper.release()
    assert FlashFile(path).image == b"image"
    assert os.listdir(tmp_path) == ["flash"]


def test_a_flash_that_cannot_be_stored_does_not_stop_the_machine(tmp_path, caplog):
    folder = tmp_path / "folder"
    folder.mkdir()
    twin = FlashTwin(b"1")
    FlashFile(folder / "flash").attach(twin)
    shutil.rmtree(folder)
    with pytest.raises(FileNotFoundError):
        twin.on_flash(b"2")
    assert "could not be stored" in caplog.text
    assert str(folder / "flash") in caplog.text


def test_writers_of_one_process_do_not_tear_each_others_files(tmp_path):
    """Two threads replace one file by turns; whoever reads it sees one of them, whole."""
    path = tmp_path / "file"
    images = [bytes([number]) * 20_000 for number in (1, 2)]
    atomic_write(path, images[0])
    done = threading.Event()
    failed: list[BaseException] = []

    def write(image: bytes) -> None:
        try:
            for _ in range(150):
                atomic_write(path, image)
        except BaseException as error:
            failed.append(error)

    writers = [threading.Thread(target=write, args=(image,)) for image in images]
    torn = 0

    def read() -> None:
        nonlocal torn
        while not done.is_set():
            torn += path.read_bytes() not in images

    reader = threading.Thread(target=read)
    for thread in (*writers, reader):
        thread.start()
    for thread in writers:
        thread.join()
    done.set()
    reader.join()
    assert (failed, torn) == ([], 0)
    assert os.listdir(tmp_path) == ["file"]


def test_a_flash_file_has_one_owner_within_a_process(tmp_path):
    path = tmp_path / "flash"
    owner = FlashFile(path)
    owner.attach(FlashTwin(None))
    (tmp_path / "other name").symlink_to(path)
    for name in ("flash", "other name"):
        with pytest.raises(OSError, match="in use by another twin, in this process") as caught:
            FlashFile(tmp_path / name).attach(FlashTwin(None))
        assert "\n" not in str(caught.value)
        assert caught.value.filename == str(tmp_path / name)
    owner.release()
    FlashFile(path).attach(FlashTwin(None))


def test_a_flash_file_is_nobodys_before_there_is_a_twin(tmp_path):
    """A twin that could not be built keeps nobody from the file."""
    first, second = FlashFile(tmp_path / "flash"), FlashFile(tmp_path / "flash")
    second.attach(FlashTwin(b"1"))
    second.release()
    with pytest.raises(OSError, match="has been changed by another twin meanwhile"):
        first.attach(FlashTwin(None))
    assert (tmp_path / "flash").read_bytes() == b"1"


HOLD = """
import sys, time
from pathlib import Path
from isel_twin.core.flash import FlashFile
keeper = FlashFile(Path(sys.argv[1]))
keeper.hold()
print("held", flush=True)
time.sleep(600)
"""


def test_a_flash_file_has_one_owner_among_processes_and_none_after_a_kill(tmp_path):
    path = tmp_path / "flash"
    other = subprocess.Popen([sys.executable, "-c", HOLD, str(path)], stdout=subprocess.PIPE, text=True)
    try:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        with pytest.raises(OSError, match=f"in use by another twin, in process {other.pid}; stop that one"):
            FlashFile(path).hold()
    finally:
        other.send_signal(signal.SIGKILL)
        other.communicate()
    keeper = FlashFile(path)
    keeper.hold()
    keeper.release()
    assert os.listdir(tmp_path) == []


def test_a_flash_file_whose_owner_is_garbage_is_free(tmp_path):
    class Loop:
        """Garbage that only the collector finds."""

        def __init__(self) -> None:
            self.keeper = FlashFile(tmp_path / "flash")
            self.keeper.hold()
            self.itself = self

    gc.disable()
    try:
        Loop()
        FlashFile(tmp_path / "flash").hold()
    finally:
        gc.enable()


def test_a_fork_does_not_let_go_of_what_its_parent_holds(tmp_path):
    claim = Claim(tmp_path / "thing")
    code = (
        "import os, sys\n"
        "from isel_twin.base.files import Claim\n"
        "claim = Claim(sys.argv[1])\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    sys.exit(0)\n"  # runs what is to be done at the end of a process
        "os.waitpid(child, 0)\n"
        "assert os.path.exists(sys.argv[2])\n"
    )
    arguments = [str(tmp_path / "other"), str(tmp_path / ".other.lock")]
    assert subprocess.run([sys.executable, "-c", code, *arguments], check=False).returncode == 0
    claim.release()
    assert os.listdir(tmp_path) == []


def test_many_who_want_one_thing_get_it_one_after_the_other(tmp_path):
    """The lock file is removed and made anew all the time; never do two have it."""
    code = (
        "import sys, os\n"
        "from isel_twin.base.files import Claim\n"
        "had = 0\n"
        "while had < 100:\n"
        "    try:\n"
        "        claim = Claim(sys.argv[1])\n"
        "    except OSError:\n"
        "        continue\n"
        "    os.close(os.open(sys.argv[2], os.O_CREAT | os.O_EXCL))\n"  # raises if somebody else is inside
        "    os.unlink(sys.argv[2])\n"
        "    claim.release()\n"
        "    had += 1\n"
    )
    arguments = [str(tmp_path / "thing"), str(tmp_path / "inside")]
    others = [subprocess.Popen([sys.executable, "-c", code, *arguments]) for _ in range(3)]
    assert [other.wait(PATIENCE_S) for other in others] == [0, 0, 0]
    assert os.listdir(tmp_path) == []


def test_what_a_killed_owner_has_begun_to_write_is_removed(tmp_path):
    path = tmp_path / "flash"
    path.write_bytes(b"image")
    killed = subprocess.Popen([sys.executable, "-c", ""])
    killed.wait()
    other = f".flash.b.{killed.pid}-0.tmp"
    (tmp_path / f".flash.{killed.pid}-0.tmp").write_bytes(b"half")
    (tmp_path / other).write_bytes(b"somebody else's")
    keeper = FlashFile(path)
    keeper.attach(FlashTwin(b"image"))
    keeper.release()
    assert sorted(os.listdir(tmp_path)) == [other, "flash"]


def test_a_released_flash_file_can_be_held_again_unless_it_has_changed(tmp_path, caplog):
    path = tmp_path / "flash"
    keeper, twin = FlashFile(path), FlashTwin(b"1")
    keeper.attach(twin)
    keeper.release()
    with pytest.raises(OSError, match="has been let go"):
        twin.on_flash(b"lost")
    assert "has been let go" in caplog.text
    keeper.hold()
    twin.on_flash(b"2")
    keeper.release()
    assert path.read_bytes() == b"2"
    other = FlashFile(path)
    other.attach(FlashTwin(b"3"))
    with pytest.raises(OSError, match="in use"):
        keeper.hold()
    other.release()
    with pytest.raises(OSError, match="changed by another twin"):
        keeper.hold()
    FlashFile(path).hold()


def test_a_flash_file_that_cannot_be_made_is_named_and_nobodys(tmp_path):
    for _ in range(2):
        with pytest.raises(FileNotFoundError) as caught:
            FlashFile(tmp_path / "nowhere" / "flash").attach(FlashTwin(None))
        assert caught.value.filename == str(tmp_path / "nowhere" / "flash")


def test_the_flash_file_of_a_twin_is_known(tmp_path):
    twin = FlashTwin(None)
    assert flash_file(twin) is None
    keeper = FlashFile(tmp_path / "flash")
    keeper.attach(twin)
    assert flash_file(twin) is keeper


@pytest.mark.parametrize("path", ["/dev/zero", "/dev/null", "pipe", ".", "large"])
def test_only_a_regular_file_of_sane_size_is_a_flash_memory(tmp_path, path):
    os.mkfifo(tmp_path / "pipe")
    with open(tmp_path / "large", "wb") as large:
        large.truncate(FLASH_BYTES + 1)
    with pytest.raises(OSError, match=r"no regular file|Is a directory|larger than 16 MiB") as caught:
        FlashFile(tmp_path / path)
    assert "\n" not in str(caught.value)
    assert sorted(os.listdir(tmp_path)) == ["large", "pipe"]


def test_without_locks_of_the_operating_system_there_is_one_owner_in_a_process(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)  # as on Windows
    claim = Claim(tmp_path / "thing")
    with pytest.raises(OSError, match="in use"):
        Claim(tmp_path / "thing")
    claim.release()
    Claim(tmp_path / "thing").release()
    assert os.listdir(tmp_path) == []
