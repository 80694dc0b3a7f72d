"""Pages and terminals: jobs, programs and their names as an attacker writes them, and what is made of them.

A page has no element and no attribute of the job's, and all its elements close; a terminal gets no character that steers
it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from random import Random
from subprocess import CompletedProcess

from tests.fuzz.mutate import restructured
from tests.fuzz.trial import Reader
from tests.in_process import isel_twin

HOSTILE = (
    "<zz onzz=1>", "'><zz zz='", '"><zz zz="', "' zz='1", '" zz="1', "</title><zz>", "</script><script>zz()</script>",
    "</style><zz>", "<!-- zz", "]]><zz>", "--><zz>", "&#60;zz&#62;", "&lt;zz&gt;", "<svg onload=zz()>", "</td></table><zz>",
    "javascript:zz()", "{{zz}}", "${zz}", "<zz", "\\x1b[31mzz", "\x1b[2J", "\x1b]0;zz\x07", "\x9b31m", "\x85", "\x08\x08",
    "\r", "\u202ezz", "\u2028", "\ufeff", "\x00", "\xad", "é ☃", "\t",
)  # fmt: skip
VOID = {"meta", "br", "hr", "img", "input", "link", "wbr", "col"}
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


def sprinkled(data: bytes, seed: int) -> bytes:
    """Hostile words at one to five places, as a comment, an argument or a line."""
    draw = Random(seed)
    text = restructured(data, seed).decode("latin-1") if draw.random() < 0.3 else data.decode("latin-1")
    for _ in range(draw.randint(1, 5)):
        at = draw.randrange(len(text) + 1)
        lead = draw.choice(("", "", " ", "# ", "\n", "(", "\n# "))
        text = text[:at] + lead + draw.choice(HOSTILE) + text[at:]
    return text.encode("utf-8", "surrogateescape")


def _name(path: Path) -> Path:
    """The job under a name that is hostile too, drawn from its content."""
    data = path.read_bytes()
    draw = Random(data)
    word = "".join(draw.choice(HOSTILE) for _ in range(2)).replace("/", "").replace("\0", "")[:60]
    hostile = path.with_name(f"{word}{path.suffix}")
    hostile.write_bytes(data)
    return hostile


def _run_page(path: Path) -> None:
    _made_page(_name(path), "run", "--plant", "kinematic")


def _check_page(path: Path) -> None:
    job, folder = _name(path), path.parent / "pages"
    done = isel_twin("check", job, "--plant", "kinematic", "--report", folder)
    check_terminal(done)
    job.unlink()
    pages = list(folder.glob("*.htm*")) if folder.is_dir() else []
    for page in pages:
        check_page(page.read_text(encoding="utf-8"))
        page.unlink()
    if not pages:
        raise ValueError("no page")


def _made_page(job: Path, command: str, *words: object) -> None:
    page = job.with_name("page.html")
    done = isel_twin(command, job, *words, "--report", page)
    check_terminal(done)
    job.unlink()
    if not page.is_file():
        raise ValueError("no page")
    check_page(page.read_text(encoding="utf-8"))
    page.unlink()


def _compared(path: Path) -> None:
    """Two recordings of the same job under hostile names, as a page and in a terminal."""
    job = _name(path)
    recorded = []
    for seed in (1, 2):
        name = job.with_suffix(f".{seed}.mcap")
        check_terminal(isel_twin("run", job, "--plant", "kinematic", "--seed", seed, "--record", name))
        recorded.append(name)
    job.unlink()
    if not all(name.is_file() for name in recorded):
        raise ValueError("no page")
    page = path.with_name("compared.html")
    check_terminal(isel_twin("compare", *recorded, "--report", page))
    check_page(page.read_text(encoding="utf-8"))
    for made in (page, *recorded):
        made.unlink()


def _terminal(*calls: tuple[object, ...]) -> Callable[[Path], None]:
    """Commands with the file as their last word."""

    def read(path: Path) -> None:
        job = _name(path)
        codes = []
        for call in calls:
            done = isel_twin(*(job if word == "FILE" else word for word in call))
            check_terminal(done)
            codes.append(done.returncode)
        job.unlink()
        if 2 in codes:
            raise ValueError("refused")

    return read


JOB = b"@07\n@0N7\n# a job\n@0A1600,800,0,30,0,30,0,30\n! x == 5 +- 0.1 mm\n@0P => *\n@0X\n"
NCP = b"IMF_PBL part\nN5 VEL 9000\nFASTABS X1000 Y2000\n; a part\nMOVEABS Z-500\nPROGEND\n"
GCODE = b"%\n(a part)\nG21 G90\nG0 X1 Y2\nG1 Z-.5 F300\nM30\n%\n"
EITHER_PLANT = ("--plant", "kinematic")


def _bytes(data: bytes) -> Callable[[Path], bytes]:
    return lambda _: data


SHOWN = (
    Reader("page-run.txt", _bytes(JOB), _run_page, sprinkled, "no page"),
    Reader("page-check.txt", _bytes(JOB), _check_page, sprinkled, "no page"),
    Reader("page-compare.txt", _bytes(JOB), _compared, sprinkled, "no page"),
    Reader(
        "terminal-job.txt",
        _bytes(JOB),
        _terminal(
            ("run", "FILE", *EITHER_PLANT), ("check", "FILE", *EITHER_PLANT), ("check", "FILE", "--json", *EITHER_PLANT),
            ("decode", "FILE"), ("golden", "compare", "FILE"),
        ),
        sprinkled,
        "refused",
    ),
    Reader("terminal-part.ncp", _bytes(NCP), _terminal(("convert", "FILE"), ("check", "FILE")), sprinkled, "refused"),
    Reader("terminal-part.ngc", _bytes(GCODE), _terminal(("convert", "FILE"), ("check", "FILE")), sprinkled, "refused"),
)  # fmt: skip
