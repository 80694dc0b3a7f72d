"""Foreign text for terminals and logs: what would steer them, or turn the text around, is shown as an escape.

Names of files, bytes of hosts and lines of jobs come from anybody. ESC would colour or clear a terminal, CR hide what
stands before it, U+202E show a name backwards; a lone surrogate (a file name that is not UTF-8) cannot be written.
"""

from __future__ import annotations

import re
from typing import Any, TextIO

# controls but tab and line end, marks of direction and width, separators of lines, surrogates, no characters
_STEERS = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ud800-\udfff\ufeff"
    "\ufff9-\ufffb\ufffe\uffff\U000e0000-\U000e007f]"
)


def shown(text: str) -> str:
    r"""Text with \x1b, \u202e and the like in place of the characters that steer; line ends and tabs stay."""
    return _STEERS.sub(lambda match: ascii(match[0])[1:-1], text)


def shown_line(text: str) -> str:
    """Text of one line: as `shown`, with escapes for line ends, too."""
    return shown(text).replace("\n", "\\n")


class ShownStream:
    """A text stream that writes text as `shown`. All else is the stream's own."""

    def __init__(self, stream: TextIO) -> None:
        self.rich_proxied_file = stream  # the name by which rich, whose colours are escapes, finds the stream itself

    def write(self, text: str) -> int:
        self.rich_proxied_file.write(shown(text))
        return len(text)

    def writelines(self, lines: list[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.rich_proxied_file, name)


def unchanged(stream: TextIO) -> TextIO:
    """The stream behind a `ShownStream`, for data and for rich; any other as it is."""
    return stream.rich_proxied_file if isinstance(stream, ShownStream) else stream
