"""The language server: each open job is judged when it has changed, and the editor is told what was found.

    editor ---- didOpen, didChange, didSave ---> server ---- text, after DEBOUNCE_S ---> LiveJob, in the worker thread
      ^                                             | a later change gives up the earlier judgement
      `---- diagnostics, hints, hover <-------------'

Typing is never held up: the thread that reads from the editor judges nothing. One worker thread does, one text after
the other, so that a twin is used by one thread only.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from lsprotocol import types
from pygls.lsp.server import LanguageServer
from pygls.uris import to_fs_path

from isel_twin.base.crew import GivenUp
from isel_twin.base.errors import CallError, one_line
from isel_twin.bridge.editor import shown
from isel_twin.jobs import project
from isel_twin.jobs.checks import Report
from isel_twin.jobs.checks.live import LiveJob
from isel_twin.jobs.job import JobError
from isel_twin.version import VERSION

DEBOUNCE_S = 0.1  # without a change before a text is judged


class _Open:
    """A job that is open in the editor."""

    def __init__(self, live: LiveJob) -> None:
        self.live = live
        self.judging: asyncio.Task[None] | None = None
        self.given_up = threading.Event()  # of the judgement in progress

    def give_up(self) -> None:
        self.given_up.set()
        if self.judging is not None:
            self.judging.cancel()


class JobServer(LanguageServer):
    """Serves the jobs of an editor."""

    def __init__(self, settings: Path | None = None, options: Mapping[str, Any] | None = None) -> None:
        """settings, options: as for `LiveJob`."""
        super().__init__("isel-twin", VERSION)
        self._settings, self._options = settings, options
        self._jobs: dict[str, _Open] = {}
        self._worker = ThreadPoolExecutor(1)
        for name, do in (
            (types.TEXT_DOCUMENT_DID_OPEN, self._opened),
            (types.TEXT_DOCUMENT_DID_CHANGE, self._changed),
            (types.TEXT_DOCUMENT_DID_SAVE, self._saved),
            (types.TEXT_DOCUMENT_DID_CLOSE, self._closed),
            (types.TEXT_DOCUMENT_HOVER, self._hover),
            (types.TEXT_DOCUMENT_INLAY_HINT, self._hints),
        ):
            self.feature(name)(partial(do))  # a method takes no marks

    def end(self) -> None:
        """Give up what is being judged."""
        for job in self._jobs.values():
            job.given_up.set()
        self._worker.shutdown(cancel_futures=True)

    def _opened(self, params: types.DidOpenTextDocumentParams) -> None:
        uri = params.text_document.uri
        path = Path(to_fs_path(uri) or "untitled.txt")
        if path.name != project.FILE:
            self._jobs[uri] = _Open(LiveJob(path, self._settings, self._options))
            self._judge(uri, 0.0)

    def _changed(self, params: types.DidChangeTextDocumentParams) -> None:
        self._judge(params.text_document.uri, DEBOUNCE_S)

    def _saved(self, params: types.DidSaveTextDocumentParams) -> None:
        """Bounds may have been saved, or what stands beside a job."""
        for uri in self._jobs:
            self._judge(uri, 0.0)

    def _closed(self, params: types.DidCloseTextDocumentParams) -> None:
        if (job := self._jobs.pop(params.text_document.uri, None)) is not None:
            job.give_up()
            self._publish(params.text_document.uri, [])

    def _judge(self, uri: str, wait_s: float) -> None:
        if (job := self._jobs.get(uri)) is not None:
            job.give_up()
            job.given_up = threading.Event()
            job.judging = asyncio.get_running_loop().create_task(self._judged(uri, job, wait_s))

    async def _judged(self, uri: str, job: _Open, wait_s: float) -> None:
        await asyncio.sleep(wait_s)
        document = self.workspace.get_text_document(uri)
        text, version, units = document.source, document.version, document.position_codec.client_num_units
        loop = asyncio.get_running_loop()
        told = await loop.run_in_executor(self._worker, _report, job.live, text, job.given_up)
        lines = shown.lines_of(text)
        if isinstance(told, str):
            self._publish(uri, shown.of_error(told, lines, units), version)
        elif told is not None:
            self._publish(uri, shown.of_report(told, job.live.figures, lines, units), version)
            if self._refreshes_hints:
                self.workspace_inlay_hint_refresh(None)

    @property
    def _refreshes_hints(self) -> bool:
        asked = self.client_capabilities.workspace
        return bool(asked and asked.inlay_hint and asked.inlay_hint.refresh_support)

    def _publish(self, uri: str, found: list[types.Diagnostic], version: int | None = None) -> None:
        self.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri, found, version))

    def _hover(self, params: types.HoverParams) -> types.Hover | None:
        if (job := self._jobs.get(params.text_document.uri)) is None:
            return None
        document = self.workspace.get_text_document(params.text_document.uri)
        lines, row = shown.lines_of(document.source), params.position.line
        if row >= len(lines):
            return None
        return shown.explained(job.live.explained(row + 1, lines[row]), job.live.figures.get(row + 1))

    def _hints(self, params: types.InlayHintParams) -> list[types.InlayHint]:
        if (job := self._jobs.get(params.text_document.uri)) is None:
            return []
        document = self.workspace.get_text_document(params.text_document.uri)
        first, last = params.range.start.line, params.range.end.line
        units = document.position_codec.client_num_units
        return shown.hints(job.live.figures, shown.lines_of(document.source), first, last, units)


def _report(live: LiveJob, text: str, given_up: threading.Event) -> Report | str | None:
    """In the worker thread: the report, what is wrong with the text, or None: nobody waits for it any more."""
    try:
        return live.report(text.encode("utf-8", "replace"), given_up.is_set)
    except GivenUp:
        return None
    except (JobError, CallError) as error:
        return str(error)
    except Exception as error:  # a plug-in's controller may raise anything, and the next text may be judged again
        return f"{type(error).__name__}: {one_line(str(error))}"
