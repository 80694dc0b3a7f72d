"""Files that `check` takes: those named, the job files of a folder, or what isel-twin.toml names."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli.outputs import say

COMMANDS = ".txt"  # suffix of a job of commands
SHOWN = 5  # most files that are named as passed over


def job_suffixes() -> frozenset[str]:
    """By these a file of a folder is a job: those that the installed readers know, and that of a job of commands."""
    from isel_twin.cam.registry import reader_suffixes

    return frozenset({COMMANDS, *reader_suffixes()})


def chosen(jobs: Sequence[Path], settings: Path | None) -> list[Path]:
    """The files to judge, each once, those of folders in the order of their names. A folder that is empty or may not be
    read, and a pattern of the settings that nothing matches, stay as they are: there is nothing to read. Raises
    CallError if nothing is named."""
    passed: list[Path] = []
    every = list(jobs) or list(_of_project(settings, passed))
    found = dict.fromkeys(file for job in every for file in _files(job, passed))
    if passed:
        names = ", ".join(map(str, passed[:SHOWN]))
        more = f" and {len(passed) - SHOWN} more" if len(passed) > SHOWN else ""
        say(f"passed over, as no job has such a name, or as links to folders: {names}{more}")
    return list(found)


def _files(job: Path, passed: list[Path]) -> Iterator[Path]:
    if not job.is_dir():
        yield job
        return
    before, suffixes = len(passed), job_suffixes()
    found: list[Path] = []
    for folder, folders, names in os.walk(job, onerror=lambda error: found.append(Path(error.filename))):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        passed += [path for name in folders if (path := Path(folder, name)).is_symlink()]  # which are not walked
        for name in sorted(names):
            if not name.startswith("."):
                file = Path(folder, name)
                (found if file.suffix.lower() in suffixes else passed).append(file)
    passed[before:] = sorted(passed[before:])
    yield from found or [job]


def _of_project(settings: Path | None, passed: list[Path]) -> Iterator[Path]:
    """Files that [check] jobs of the settings file names, as seen from here."""
    from isel_twin.jobs import project
    from isel_twin.jobs.checks.settings import jobs_of

    file = settings if settings is not None else project.find(Path(project.FILE))
    with call_errors(file):
        named = [] if file is None else jobs_of(file)
    if not named or file is None:
        raise CallError(
            f'name the jobs: isel-twin check JOB..., or a folder; or in {project.FILE}: [check] jobs = ["jobs"]'
        )
    above = file.resolve().parent
    seen = Path(os.path.relpath(above))
    for pattern in named:
        matching = sorted(glob.glob(pattern, root_dir=above, recursive=True)) or [pattern]
        for name in matching:
            path = seen / name
            other = path.is_symlink() if path.is_dir() else path.suffix.lower() not in job_suffixes()
            if pattern != name and other:
                passed.append(path)
            else:
                yield path
