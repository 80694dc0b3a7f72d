"""Errors of a caller, as one line that says why and what to do."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class CallError(ValueError):
    """A call cannot be carried out; the message is one line that says why and what to do.

    option: the line begins with the bare name of an option (as in a URL); a command line puts "--" before it. excerpt:
    lines to show below it, such as a line of a file with a caret.
    """

    def __init__(self, line: str, *, option: bool = False, excerpt: str = "") -> None:
        super().__init__(line)
        self.option = option
        self.excerpt = excerpt


def one_line(text: str) -> str:
    """The text with every stretch of white space as one blank."""
    return " ".join(text.split())


@contextmanager
def call_errors(about: object = None) -> Iterator[None]:
    """Turn OSError, ValueError and the like into CallError; `about` is the file it names if the error has none."""
    try:
        yield
    except CallError:
        raise
    except OSError as error:
        where = error.filename2 or error.filename or about
        if isinstance(error, FileNotFoundError):
            raise CallError(f"{where}: there is no such file") from error
        if isinstance(error, IsADirectoryError):
            raise CallError(f"{where}: is a folder, not a file") from error
        raise CallError(f"{f'{where}: ' if where else ''}{error.strerror or error}") from error
    except ValueError as error:
        raise CallError(one_line(str(error))) from error
