"""Own files trust nobody: links planted in the place of a lock, a temporary file or a journal harm no other file, and
one module alone opens files for writing.
"""

from __future__ import annotations

import ast
import fcntl
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from isel_twin.base import files
from isel_twin.base.files import Claim, Replacement, alone, appending, atomic_write, create, planted, replacing

PACKAGE = Path(files.__file__).parents[2]
PRECIOUS = b"years of work"


@pytest.fixture
def precious(tmp_path):
    path = tmp_path / "elsewhere"
    path.write_bytes(PRECIOUS)
    return path


@pytest.fixture
def shared(tmp_path):
    """A folder where everybody may write."""
    folder = tmp_path / "shared"
    folder.mkdir()
    folder.chmod(0o1777)
    return folder


def ended_pid() -> int:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    return ended.pid


# ---- locks ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "plant", [os.symlink, os.link, lambda _, name: os.mkfifo(name), lambda _, name: os.mkdir(name)]
)
def test_a_planted_lock_is_refused_by_its_name_and_leads_nowhere(shared, precious, plant):
    plant(precious, shared / ".thing.lock")
    with pytest.raises(OSError, match=r"\.thing\.lock is a link or no regular file; remove it") as caught:
        Claim(shared / "thing")
    assert caught.value.filename == str(shared / "thing")
    assert precious.read_bytes() == PRECIOUS


@pytest.mark.parametrize("there", [True, False])
def test_the_lock_of_all_users_follows_no_link(shared, precious, there):
    target = precious if there else shared.parent / "made by the link"
    (shared / "all.lock").symlink_to(target)
    before = target.stat().st_mode if there else None
    with pytest.raises(OSError, match="is a link"), alone(shared / "all.lock"):
        pass
    assert (target.stat().st_mode if target.exists() else None) == before


def test_the_lock_of_all_users_is_readable_and_has_one_owner(shared):
    before = os.umask(0o077)
    try:
        with alone(shared / "all.lock"), open(shared / "all.lock") as lock, pytest.raises(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    finally:
        os.umask(before)
    assert (shared / "all.lock").stat().st_mode & 0o777 == 0o644


# ---- temporary files -----------------------------------------------------------------------------------------------


def test_no_two_temporary_names_are_alike_nor_follow_from_each_other(shared):
    names = set()
    for _ in range(8):
        with replacing(shared / "out"):
            (name,) = (name for name in os.listdir(shared) if name.endswith(".tmp"))
        assert name.startswith(f".out.{os.getpid()}-")
        names.add(name.split("-")[1].removesuffix(".tmp"))
    assert len(names) == 8
    assert {len(name) for name in names} == {16}, "64 random bits"


def test_what_is_planted_while_a_file_is_written_gets_none_of_it(shared, precious):
    """The temporary name is taken away and becomes a link: data go on to the file that was made."""
    with replacing(shared / "out") as file:
        (name,) = os.listdir(shared)
        (shared / name).unlink()
        (shared / name).symlink_to(precious)
        file.write(b"new")
        file.flush()
        assert precious.read_bytes() == PRECIOUS
    assert precious.read_bytes() == PRECIOUS


def test_a_link_that_appears_in_the_place_of_the_file_is_replaced_not_followed(shared, precious):
    with replacing(shared / "out") as file:
        file.write(b"new")
        (shared / "out").symlink_to(precious)
    assert (shared / "out").read_bytes() == b"new"
    assert not (shared / "out").is_symlink()
    assert precious.read_bytes() == PRECIOUS


def test_a_folder_that_is_exchanged_meanwhile_gets_nothing(tmp_path):
    folder, other = tmp_path / "folder", tmp_path / "other"
    folder.mkdir()
    other.mkdir()
    with replacing(folder / "out") as file:
        file.write(b"new")
        folder.rename(tmp_path / "moved")
        folder.symlink_to(other)
    assert os.listdir(other) == []
    assert (tmp_path / "moved" / "out").read_bytes() == b"new"


def test_a_recording_goes_on_in_its_own_file_after_its_head_is_in_place(shared, precious):
    new = Replacement(shared / "out")
    new.file.write(b"head")
    new.put()
    (shared / "out").rename(shared / "kept")
    (shared / "out").symlink_to(precious)
    new.file.write(b", rest")
    new.close()
    assert (shared / "kept").read_bytes() == b"head, rest"
    assert precious.read_bytes() == PRECIOUS


def test_a_key_is_for_its_owner_alone_from_its_first_byte(shared):
    with replacing(shared / "key", 0o600) as file:
        (name,) = os.listdir(shared)
        assert (shared / name).stat().st_mode & 0o777 == 0o600
        file.write(b"secret")
    assert (shared / "key").stat().st_mode & 0o777 == 0o600


def status(mode: int, owner: int) -> os.stat_result:
    return SimpleNamespace(st_mode=mode, st_uid=owner)  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("folder", "folder_owner", "link_owner", "trap"),
    [
        (0o1777, 0, 1001, True),  # somebody else's in /tmp
        (0o0777, 1002, 1001, True),
        (0o1777, 0, 1000, False),  # my own
        (0o1777, 1001, 1001, False),  # of whom the folder is
        (0o1777, 1002, 0, False),  # the system's
        (0o0755, 1001, 1001, False),  # a folder of another user, who alone writes there
    ],
)
def test_a_link_of_another_user_in_a_folder_for_everybody_is_a_trap(folder, folder_owner, link_owner, trap):
    """The table of proc(5), protected_symlinks, for user 1000; the system is trusted besides."""
    assert planted(status(0o777, link_owner), status(folder, folder_owner), 1000) is trap


def test_a_trap_is_refused_and_its_target_stays(shared, precious, monkeypatch):
    (shared / "out").symlink_to(precious)
    monkeypatch.setattr(files, "planted", lambda *_: True)
    for write in (lambda path: atomic_write(path, b"new"), appending):
        with pytest.raises(PermissionError, match="is a link that another user has made in a folder for everybody"):
            write(shared / "out")
    assert precious.read_bytes() == PRECIOUS


# ---- left-overs ----------------------------------------------------------------------------------------------------


def test_left_overs_of_killed_processes_go_when_the_file_is_written_again(tmp_path):
    pid = ended_pid()
    for name in (f".out.{pid}-0123456789abcdef.tmp", f".out.{pid}-3.tmp", f".out.{pid}.tmp"):
        (tmp_path / name).write_bytes(b"half")
    atomic_write(tmp_path / "out", b"whole")
    assert os.listdir(tmp_path) == ["out"]


def test_what_is_no_left_over_stays(tmp_path, precious):
    pid = ended_pid()
    (tmp_path / f".out.{os.getpid()}-0123456789abcdef.tmp").write_bytes(b"is being written")
    (tmp_path / f".out.b.{pid}-0123456789abcdef.tmp").write_bytes(b"of another file")
    (tmp_path / f".out.{pid}-notes.tmp").write_bytes(b"of another pattern")
    (tmp_path / f".out.{pid}-1.tmp").symlink_to(precious)
    (tmp_path / f".out.{pid}-2.tmp").mkdir()
    os.mkfifo(tmp_path / f".out.{pid}-3.tmp")
    with open(tmp_path / f".out.{pid}-4.tmp", "wb") as held:  # by a process in another container
        fcntl.flock(held, fcntl.LOCK_EX)
        before = set(os.listdir(tmp_path))
        atomic_write(tmp_path / "out", b"whole")
    assert set(os.listdir(tmp_path)) == before | {"out"}


def test_a_left_over_of_another_user_stays(tmp_path, monkeypatch):
    left = tmp_path / f".out.{ended_pid()}-1.tmp"
    left.write_bytes(b"half")
    monkeypatch.setattr(os, "geteuid", lambda: left.stat().st_uid + 1)
    atomic_write(tmp_path / "out", b"whole")
    assert left.exists()


# ---- journals and new files ----------------------------------------------------------------------------------------


def test_a_journal_is_added_to_and_a_hard_link_or_pipe_in_its_place_is_refused(shared, precious):
    for line in ("1\n", "2\n"):
        with appending(shared / "journal") as file:
            file.write(line)
    assert (shared / "journal").read_text() == "1\n2\n"
    os.link(precious, shared / "linked")
    os.mkfifo(shared / "pipe")
    for name in ("linked", "pipe"):
        with pytest.raises(OSError) as caught:  # noqa: PT011  (the kernel may refuse it first)
            appending(shared / name)
        assert caught.value.filename == str(shared / name)
    assert precious.read_bytes() == PRECIOUS


def test_a_new_file_is_never_one_that_there_was(shared, precious):
    (shared / "there").symlink_to(precious)
    (shared / "dangling").symlink_to(shared / "nothing")
    for name in ("there", "dangling"):
        with pytest.raises(FileExistsError):
            create(shared / name)
    assert precious.read_bytes() == PRECIOUS
    assert not (shared / "nothing").exists()


# ---- one door ------------------------------------------------------------------------------------------------------

ALLOWED = {
    "twin/base/files.py": "the door",
    "twin/cli/__init__.py": "the null device, in place of closed standard files",
    "twin/cli/lsp.py": "standard output",
    "twin/recordings/recorder.py": "a file without a name",
    "twin/recordings/container.py": "a file without a name",
    "twin/recordings/npz.py": "into an archive that the door has opened",
    "twin/capture/player.py": "into memory",
    "twin/native/compiling.py": "stands alone: it runs before the package is installed",
    "bridge/serve/keeping.py": "a new folder of its own in the temporary folder",
    "bridge/serve/pty.py": "the link to a pseudo terminal, which replaces nothing",
    "bridge/serve/registry.py": "a rename within a folder of this user alone",
    "bridge/serve/tcp.py": "the null device, to be read",
    "bridge/virtual/virtual_serial.py": "the null device, for select",
    "bridge/linuxcnc/session.py": "links in a new folder of its own",
}
WRITERS = {
    *("write_text", "write_bytes", "symlink_to", "hardlink_to", "symlink", "mkfifo", "mkstemp", "mkdtemp"),
    *("NamedTemporaryFile", "TemporaryFile", "SpooledTemporaryFile", "copyfile", "copy2", "copytree", "savez"),
    *("savez_compressed", "savetxt", "tofile", "FileHandler", "mj_saveModel", "mj_saveLastXML", "fdopen", "rename"),
}
MODES = set("wax+")


def opens_for_writing(call: ast.Call) -> bool:
    """True for a call that may open a file for writing. A mode or flags that are computed count, too."""
    function = call.func
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    if name in WRITERS or (name == "touch" and not call.args):
        return True
    if name != "open":
        return False
    owner = function.value.id if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name) else ""
    if owner == "os":
        return True
    if owner in ("webbrowser", "serial"):
        return False
    given = {word.arg: word.value for word in call.keywords}
    place = 0 if isinstance(function, ast.Attribute) and owner != "io" else 1
    modes = [given["mode"]] if "mode" in given else call.args[place : place + 2]
    return any(not isinstance(mode, ast.Constant) or bool(MODES & set(str(mode.value))) for mode in modes)


def openings(source: str) -> Iterator[int]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and opens_for_writing(node):
            yield node.lineno


@pytest.mark.parametrize(
    "line",
    [
        "open(path, 'w')",
        "open(path, mode='a')",
        "path.open('x')",
        "io.open(path, 'r+')",
        "open(path, mode)",
        "os.open(path, flags)",
        "path.write_text(text)",
        "path.touch()",
        "tempfile.mkstemp()",
        "zipfile.ZipFile.open(a, 'w')",
    ],
)
def test_the_search_finds_an_opening_for_writing(line):
    assert list(openings(line)) == [1]


@pytest.mark.parametrize("line", ["open(path)", "open(path, 'rb')", "path.open()", "path.open(encoding='utf-8')"])
def test_the_search_passes_over_reading(line):
    assert list(openings(line)) == []


def test_one_module_opens_files_for_writing():
    found = {}
    for top in ("twin", "bridge"):
        for path in sorted((PACKAGE / top).rglob("*.py")):
            if lines := list(openings(path.read_text(encoding="utf-8"))):
                found[path.relative_to(PACKAGE).as_posix()] = lines
    assert {name: lines for name, lines in found.items() if name not in ALLOWED} == {}, "go through base/files.py"
    assert sorted(found) == sorted(ALLOWED), "an exception that is none any more"
