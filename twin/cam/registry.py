"""The installed readers of job files, by entry points in the group `isel_twin.job_files`."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from isel_twin.base.plugins import installed
from isel_twin.cam.reader import LONGEST, Reader, statements

# factory(name) -> Reader, `name` being the entry point's
ReaderFactory = Callable[[str], Reader]

_GROUP = "isel_twin.job_files"


def reader_names() -> list[str]:
    """Names of the installed readers, sorted."""
    return sorted(entry.name for entry in installed(_GROUP))


def reader_named(name: str) -> Reader:
    """The reader of this name. Raises ValueError, in one line, if none is installed or it does not load."""
    for entry in installed(_GROUP):
        if entry.name == name:
            try:
                factory: ReaderFactory = entry.load()
                return factory(name)
            except Exception as error:
                raise ValueError(f"job files {name!r}: {entry.value} does not load: {error!r}") from error
    raise ValueError(f"unknown format {name!r}; installed: {', '.join(reader_names())}")


def reader_suffixes() -> frozenset[str]:
    """Endings of file names that the readers know, as ".ncp"."""
    return frozenset(suffix for reader in _readers() for suffix in reader.suffixes)


def reader_for(head: str, suffix: str = "") -> Reader | None:
    """The reader of a file that begins like this (`reader.head_of`); None if it is a job of
    commands or in a format that is not installed.

    The content decides; the suffix of the file's name (".ncp"), where several formats claim the content, or none
    (cam/12).
    """
    head = head[:LONGEST]
    if not statements(head):
        return None
    readers = list(_readers())
    claiming = [reader for reader in readers if reader.claims(head)]
    named = [reader for reader in claiming or readers if suffix.lower() in reader.suffixes]
    return next(iter([*named, *claiming]), None)


def _readers() -> Iterator[Reader]:
    """Readers that load."""
    for name in reader_names():
        try:
            yield reader_named(name)
        except ValueError:
            continue
