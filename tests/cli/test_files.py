"""Files appear whole or not at all, whenever the power fails."""

from __future__ import annotations

import os

import pytest

from isel_twin.files import FlashFile, atomic_write, replacing


class PowerCut(BaseException):
    """The process ends here."""


def test_a_file_is_written_and_replaced(tmp_path):
    path = tmp_path / "file"
    atomic_write(path, b"old")
    atomic_write(path, b"new")
    assert path.read_bytes() == b"new"
    assert os.listdir(tmp_path) == ["file"]


@pytest.mark.parametrize("call", ["open", "write", "fsync", "replace"])
@pytest.mark.parametrize("when", ["before", "after"])
def test_a_power_cut_at_any_step_leaves_the_old_or_the_new_file(tmp_path, monkeypatch, call, when):
    path = tmp_path / "file"
    old, new = b"old" * 1000, b"new" * 2000
    path.write_bytes(old)
    import pathlib

    owner, name = {
        "open": (os, "open"),
        "write": (pathlib.Path, "write_bytes"),
        "fsync": (os, "fsync"),
        "replace": (pathlib.Path, "replace"),
    }[call]
    real = getattr(owner, name)

    def cut(*arguments):
        if when == "after":
            real(*arguments)
        raise PowerCut

    monkeypatch.setattr(owner, name, cut)
    with pytest.raises(PowerCut):
        atomic_write(path, new)
    monkeypatch.undo()
    assert path.read_bytes() in (old, new)


def test_an_error_while_writing_leaves_the_old_file_and_no_litter(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"old")

    def fail(temporary):
        temporary.write_bytes(b"half")
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), replacing(path) as temporary:
        fail(temporary)
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
    assert path.exists()
    assert FlashFile(path).image is None
    twin.on_flash(b"image")
    assert FlashFile(path).image == b"image"


def test_a_flash_that_cannot_be_stored_does_not_stop_the_machine(tmp_path, caplog):
    folder = tmp_path / "folder"
    folder.mkdir()
    twin = FlashTwin(b"1")
    FlashFile(folder / "flash").attach(twin)
    (folder / "flash").unlink()
    folder.rmdir()
    twin.on_flash(b"2")
    assert "could not be stored" in caplog.text
