"""Pages and terminals: jobs, programs and their names as an attacker writes them, and what is made of them.

A page has no element and no attribute of the job's, and all its elements close; a terminal gets no character that
steers it.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html.parser import HTMLParser
from pathlib import Path
from random import Random
from subprocess import CompletedProcess

from tests.fuzz.mutate import Mutation, restructured
from tests.fuzz.trial import Reader
from tests.in_process import isel_twin

HOSTILE = (
    "<zz onzz=1>", "'><zz zz='", '"><zz zz="', "' zz='1", '" zz="1', "</title><zz>", "</script><script>zz()</script>",
    "</style><zz>", "<!-- zz", "]]><zz>", "--><zz>", "&#60;zz&#62;", "&lt;zz&gt;", "<svg onload=zz()>",
    "</td></table><zz>", "javascript:zz()", "{{zz}}", "${zz}", "<zz", "\\x1b[31mzz", "\x1b[2J", "\x1b]0;zz\x07",
    "\x9b31m", "\x85", "\x08\x08", "\r", "\u202ezz", "\u2028", "\ufeff", "\x00", "\xad", "é ☃", "\t",
)  # fmt: skip
VOID = {"meta", "br", "hr", "img", "input", "link", "wbr", "col"}
# elements that end a paragraph (HTML Living Standard, 13.2.6.4.7)
ENDS_P = {"p", "div", "figure", "table", "ul", "ol", "section", "nav", "header", "main", "h1", "h2", "h3", "pre"}
# what steers a terminal (ECMA-48 C0 and C1 but line end and tab, Unicode's marks of direction), written down anew
STEERS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ud800-\udfff\ufeff]")


class _Page(HTMLParser):
    """The elements of a page, open ones on a stack."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.wrong: list[str] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if "zz" in tag or any("zz" in name or name.startswith("on") for name, _ in attrs):
            self.wrong.append(f"the page has {self.get_starttag_text()}")
        if any(name in ("href", "src", "action") and not (value or "").startswith("#") for name, value in attrs):
            self.wrong.append(f"the page leads elsewhere: {self.get_starttag_text()}")
        if "p" in self.open and tag in ENDS_P:
            self.wrong.append(f"<{tag}> ends the <p> around it")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.wrong.append(f"</{tag}> closes nothing")

    def handle_comment(self, data: str) -> None:
        self.wrong.append(f"a comment: {data[:40]}")

    def handle_data(self, data: str) -> None:
        if self.open[-1:] in (["script"], ["style"]) and "zz" in data:
            self.wrong.append("words of the job in a script or style")
        self.texts.append(data)


def check_page(text: str) -> None:
    """Raise AssertionError for a page with anything in it that is not its own."""
    page = _Page()
    page.feed(text)
    page.close()
    assert not page.wrong, page.wrong[0]
    assert not page.open, f"{page.open} does not close"


def check_terminal(done: CompletedProcess[str]) -> None:
    """Raise AssertionError for characters that steer, and for a traceback."""
    for text in (done.stdout, done.stderr):
        found = STEERS.search(text)
        assert found is None, f"{' '.join(done.args)} prints {found[0]!r}: {text[max(0, found.start() - 30) :][:80]!r}"
        assert "Traceback" not in text, text[-300:]
    assert done.returncode in (0, 1, 2), done


def sprinkled(comment: str, end: str = "", command: Callable[[str], str] | None = None) -> Mutation:
    """Hostile words at one to five places: behind `comment`, in a command, seldom anywhere. command: how a command
    carries them."""

    def mutate(data: bytes, seed: int) -> bytes:
        draw = Random(seed)
        lines = data.decode().split("\n")
        for _ in range(draw.randint(1, 5)):
            at, word = draw.randrange(len(lines) - 1), draw.choice(HOSTILE)
            line, kind = lines[at], draw.random()
            place = draw.randrange(len(line) + 1)
            if kind < 0.05:
                lines[at] = line[:place] + word + line[place:]
            elif kind < 0.5 and command is not None and line[:1] not in ("!", "#", ""):
                lines[at] = line[:place] + command(word) + line[place:]
            else:
                lines[at] = f"{line}  {comment}{word.replace(end, '') if end else word}{end}"
        text = "\n".join(lines).encode("utf-8", "surrogateescape")
        return restructured(text, seed) if draw.random() < 0.2 else text

    return mutate


def in_angles(word: str) -> str:
    """Bytes of a command as a job writes them."""
    return "".join(c if " " < c < "\x7f" and c not in "<>#\\" else f"<{ord(c)}>" for c in word if ord(c) < 256)


@contextmanager
def _named(path: Path) -> Iterator[Path]:
    """The job under a name that is hostile too, drawn from its content, in a folder that is empty afterwards."""
    data = path.read_bytes()
    draw = Random(data)
    word = "".join(draw.choice(HOSTILE) for _ in range(2)).replace("/", "").replace("\0", "")[:60]
    hostile = path.with_name(f"{word}{path.suffix}")
    hostile.write_bytes(data)
    try:
        yield hostile
    finally:
        for entry in {*path.parent.iterdir()} - {path}:
            shutil.rmtree(entry) if entry.is_dir() else entry.unlink()


SLOW = 20  # files
KINEMATIC = ("--plant", "kinematic")


def _made(folder: Path, done: CompletedProcess[str]) -> None:
    """The pages in a folder are sound."""
    pages = list(folder.rglob("*.html"))
    for page in pages:
        check_page(page.read_text(encoding="utf-8"))
    if not pages:
        raise ValueError(f"no page: {done.stderr.strip().replace(chr(10), ' ')[-100:]}")


def _page(*call: object) -> Callable[[Path], None]:
    def read(path: Path) -> None:
        with _named(path) as job:
            page = job.with_name("page" if "check" in call else "page.html")
            done = isel_twin(*call, job, *KINEMATIC, "--report", page)
            check_terminal(done)
            _made(path.parent, done)

    return read


def _compared(path: Path) -> None:
    """Two recordings of the same job under hostile names, as a page and in a terminal."""
    with _named(path) as job:
        recorded = [job.with_suffix(f".{seed}.mcap") for seed in (1, 2)]
        for seed, name in enumerate(recorded):
            check_terminal(isel_twin("run", job, *KINEMATIC, "--seed", seed, "--record", name))
        done = isel_twin("compare", *recorded, "--report", path.with_name("page.html"))
        check_terminal(done)
        _made(path.parent, done)


def _terminal(*calls: tuple[object, ...]) -> Callable[[Path], None]:
    """Commands about the file. What `convert` writes is data: its standard output is not looked at."""

    def read(path: Path) -> None:
        with _named(path) as job:
            for call in calls:
                done = isel_twin(*(job if word == "FILE" else word for word in call))
                check_terminal(done if "convert" not in call else _without_data(done))
                if done.returncode == 2:
                    raise ValueError(f"refused: {done.stderr.splitlines()[-1][-80:]}")

    return read


def _without_data(done: CompletedProcess[str]) -> CompletedProcess[str]:
    return CompletedProcess(done.args, done.returncode, "", done.stderr)


JOB = b"@07\n@0N7\n# a job\n@0A1600,800,0,30,0,30,0,30\n! x == 5 +- 0.1 mm\n@0P => *\n@0X\n"
NCP = b"IMF_PBL part\nN5 VEL 9000\nFASTABS X1000 Y2000\n; a part\nMOVEABS Z-500\nPROGEND\n"
GCODE = b"%\n(a part)\nG21 G90\nG0 X1 Y2\nG1 Z-.5 F300\nM30\n%\n"


def _bytes(data: bytes) -> Callable[[Path], bytes]:
    return lambda _: data


_of_job = sprinkled("# ", "", in_angles)
_CHECKED = (("check", "FILE", *KINEMATIC), ("check", "FILE", "--json", *KINEMATIC))
_OF_JOB = _terminal(
    ("run", "FILE", *KINEMATIC), *_CHECKED, ("decode", "FILE"), ("golden", "record", "FILE", *KINEMATIC)
)
_OF_PART = _terminal(("convert", "FILE"), ("check", "FILE", *KINEMATIC))
SHOWN = (
    Reader("page-run.txt", _bytes(JOB), _page("run"), _of_job, "no page", SLOW),
    Reader("page-check.txt", _bytes(JOB), _page("check"), _of_job, "no page", SLOW),
    Reader("page-compare.txt", _bytes(JOB), _compared, _of_job, "no page", SLOW),
    Reader("terminal-job.txt", _bytes(JOB), _OF_JOB, _of_job, "refused", SLOW),
    Reader("terminal-part.ncp", _bytes(NCP), _OF_PART, sprinkled("; "), "refused", SLOW),
    Reader("terminal-part.ngc", _bytes(GCODE), _OF_PART, sprinkled("(", ")"), "refused", SLOW),
)
