"""The language server: a real process with a scripted editor, and what an editor is told."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from isel_twin.jobs.checks.live import Figures, LiveJob
from tests.forked import PATIENCE_S, PIPE, start

JOB = "@07\n@0R7\n@0A1600,3000,0,30,0,30,0,30\n"


class Editor:
    """Speaks the protocol with a server; keeps what it has published."""

    def __init__(self, process: Any) -> None:
        self._process = process
        self._number = 0
        self.capabilities = self.ask("initialize", processId=None, rootUri=None, capabilities={})["capabilities"]
        self.tell("initialized")

    def tell(self, method: str, **params: Any) -> None:
        self._send({"method": method, "params": params})

    def ask(self, method: str, **params: Any) -> Any:
        self._number += 1
        self._send({"id": self._number, "method": method, "params": params})
        return self._until(lambda message: message.get("id") == self._number)["result"]

    def published(self, version: int) -> list[tuple[str | None, int, str]]:
        """Rule, line and message of each diagnostic of this version of the job."""
        found = self._until(lambda message: message.get("params", {}).get("version") == version)
        told = found["params"]["diagnostics"]
        return [(each.get("code"), each["range"]["start"]["line"], each["message"]) for each in told]

    def _send(self, message: dict[str, Any]) -> None:
        data = json.dumps({"jsonrpc": "2.0", **message})
        self._process.stdin.write(f"Content-Length: {len(data)}\r\n\r\n{data}")
        self._process.stdin.flush()

    def _until(self, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        while True:
            length = 0
            while line := self._process.stdout.readline().strip():
                name, _, value = line.partition(":")
                length = int(value) if name.lower() == "content-length" else length
            message: dict[str, Any] = json.loads(self._process.stdout.read(length))
            if wanted(message):
                return message


@contextmanager
def editor(folder: Path) -> Iterator[Editor]:
    with start("lsp", cwd=folder, stdin=PIPE) as process:
        one = Editor(process)
        yield one
        assert one.ask("shutdown") is None
        one.tell("exit")
        assert process.wait(PATIENCE_S) == 0


def test_a_document_that_is_not_open_has_nothing_to_say(tmp_path: Path) -> None:
    """The editor's mistake is no error of the server, which would be printed with its stack."""
    document, position = {"uri": (tmp_path / "none.txt").as_uri()}, {"line": 0, "character": 0}
    with editor(tmp_path) as one:
        assert one.ask("textDocument/hover", textDocument=document, position=position) is None
        place = {"start": position, "end": position}
        assert one.ask("textDocument/inlayHint", textDocument=document, range=place) == []


def test_a_job_is_judged_as_it_is_typed(tmp_path: Path) -> None:
    """The project names the machine; three changes at once are judged as one; a line is explained."""
    (tmp_path / "isel-twin.toml").write_text('[check]\nplant = "kinematic"\ncycle_s = 34.0\n')
    uri = (tmp_path / "job.txt").as_uri()
    document = {"uri": uri}
    with editor(tmp_path) as one:
        assert one.capabilities["positionEncoding"] == "utf-16"
        one.tell("textDocument/didOpen", textDocument={**document, "languageId": "x", "version": 1, "text": JOB})
        ((rule, line, message),) = one.published(1)
        assert (rule, line) == ("cycle", 2)
        assert re.match(r"takes 34\.25\d s; at most 34 s", message)
        for version, text in ((2, "@0J"), (3, "fas"), (4, "t\n")):
            end = {"line": 3, "character": 3 * (version - 2)}
            change = {"range": {"start": end, "end": end}, "text": text}
            one.tell("textDocument/didChange", textDocument={**document, "version": version}, contentChanges=[change])
        assert [(rule, line) for rule, line, _ in one.published(4)] == [("refused", 3), ("cycle", 3)]
        words = one.ask("textDocument/hover", textDocument=document, position={"line": 2, "character": 1})
        assert "relative move by X 1600 at 3000 Hz" in words["contents"]["value"]
        whole = {"start": {"line": 0, "character": 0}, "end": {"line": 9, "character": 0}}
        hints = one.ask("textDocument/inlayHint", textDocument=document, range=whole)
        assert [hint["position"] for hint in hints] == [{"line": 1, "character": 4}, {"line": 2, "character": 27}]
        change = {"text": JOB + "! nonsense\n"}
        one.tell("textDocument/didChange", textDocument={**document, "version": 5}, contentChanges=[change])
        ((rule, line, message),) = one.published(5)
        assert (rule, line) == (None, 3)
        assert message.startswith("nonsense must be followed by")
        one.tell("textDocument/didClose", textDocument=document)


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> LiveJob:
    return LiveJob(tmp_path_factory.mktemp("project") / "job.txt", options={"plant": "kinematic", "margin": 0.2})


def utf16(text: str) -> int:
    return len(text.encode("utf-16-le")) // 2


def test_findings_are_diagnostics_at_their_lines(live: LiveJob) -> None:
    """One of the whole job stands at its first line; a remark of two units a character shifts nothing but columns."""
    from lsprotocol import types

    from isel_twin.bridge.editor import shown

    text = "# \N{WRENCH}\n" + JOB + "  @0Jfast # \N{WRENCH}\n"
    report = live.report(text.encode())
    found = shown.of_report(report, live.figures, shown.lines_of(text), utf16)
    refused, effect = sorted(found, key=lambda each: -each.range.start.line)
    assert (refused.code, refused.severity, refused.source) == ("refused", types.DiagnosticSeverity.Error, "isel-twin")
    assert (refused.range.start, refused.range.end) == (types.Position(4, 2), types.Position(4, 14))
    assert refused.message.endswith("(0.000 s)")
    assert (effect.code, effect.severity) == ("effect", types.DiagnosticSeverity.Warning)
    assert (effect.range.start, effect.range.end) == (types.Position(0, 0), types.Position(0, 4))


@pytest.mark.parametrize(
    ("message", "line", "column", "told"),
    [
        ("line 2: <300> is no byte", 1, 0, "<300> is no byte"),
        ("line 2, column 3: unknown", 1, 2, "unknown"),
        ("line 9: gone since", 2, 0, "gone since"),
        ("isel-twin.toml:2: check.margins: unknown", 0, 0, "isel-twin.toml:2: check.margins: unknown"),
    ],
)
def test_what_is_wrong_with_a_text_stands_where_it_is(message: str, line: int, column: int, told: str) -> None:
    from lsprotocol import types

    from isel_twin.bridge.editor import shown

    (found,) = shown.of_error(message, ["@07", "@0R7", ""], len)
    assert (found.range.start, found.message) == (types.Position(line, column), told)


def test_figures_stand_behind_their_lines() -> None:
    """Of those that are shown, and that take time."""
    from lsprotocol import types

    from isel_twin.bridge.editor import shown

    figures = {1: Figures(0.0), 2: Figures(33.7), 3: Figures(0.5, (0.41, "x")), 4: Figures(9.0)}
    hints = shown.hints(figures, shown.lines_of(JOB), 0, 2, len)
    assert [(hint.position.line, hint.label) for hint in hints] == [
        (1, "33.700 s"),
        (2, "0.500 s, x keeps 41 % torque"),
    ]
    hover = shown.explained(["@07: axes *X*"], Figures(0.1, replies=("0",)))
    assert hover is not None
    assert isinstance(hover.contents, types.MarkupContent)
    assert hover.contents.value == "- @07: axes \\*X\\*\n\n0.100 s\n- reply: 0"
    assert shown.explained([], None) is None
