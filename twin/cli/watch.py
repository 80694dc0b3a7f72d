"""`isel-twin check --watch`: a job judged again whenever its file changes, until Ctrl-C.

The file is asked for its time and length twenty times a second, which works on every disk and needs no library. One
that has vanished, is empty or is wrong may be half-way between two versions: that is said, and what comes next is
judged. A change in the middle of a judgement begins another one.
"""

from __future__ import annotations

import logging
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from isel_twin.base.crew import GivenUp
from isel_twin.base.errors import CallError
from isel_twin.base.quiet import quietly
from isel_twin.cli.interruption import interruption
from isel_twin.cli.outputs import console, many

if TYPE_CHECKING:
    from isel_twin.jobs.checks import Report
    from isel_twin.jobs.checks.live import LiveJob, Stamp

POLL_S = 0.05  # between two looks at the files


class _Files:
    """The job and all that its verdict depends on, as they were when last looked at."""

    def __init__(self, live: LiveJob) -> None:
        self._live = live
        self._seen: tuple[Stamp, ...] = ()
        self._asked_s = 0.0

    def changed(self) -> bool:
        """True if one of them is not as at the last `take`; asks the disk now and then only."""
        if (now_s := time.monotonic()) - self._asked_s < POLL_S:
            return False
        self._asked_s = now_s
        return self._stamps() != self._seen

    def take(self) -> bytes:
        """The job's text. Raises CallError while it has none."""
        self._seen, self._asked_s = self._stamps(), time.monotonic()
        try:
            data = self._live.job.read_bytes()
        except OSError as error:
            raise CallError(f"{self._live.job}: {error.strerror or error}; waiting for it") from None
        if not data:
            raise CallError(f"{self._live.job}: is empty; waiting for its lines")
        return data

    def _stamps(self) -> tuple[Stamp, ...]:
        from isel_twin.jobs.checks.live import stamp_of

        return (*stamp_of(self._live.job), *self._live.stamps())


def watch(job: Path, settings: Path | None, asked: dict[str, Any], json: bool) -> int:
    """Judge the job now and after each change; exit code of the last verdict."""
    from isel_twin.jobs.checks.live import LiveJob
    from isel_twin.jobs.job import JobError

    live = LiveJob(job, settings, asked)
    files, screen, ok = _Files(live), console(), False
    with quietly(logging.ERROR), interruption() as stopped:  # what the verdict says need not be said at each change
        while not stopped:
            began_s = time.monotonic()
            told: Report | str
            try:
                told = live.report(files.take(), lambda: bool(stopped) or files.changed())
            except GivenUp:
                continue
            except JobError as error:
                told = f"{job}: {error}"
            except CallError as error:
                told = str(error)
            ok = not isinstance(told, str) and told.ok
            if json:
                print(_as_json(job, told), flush=True)
            else:
                if screen.is_terminal:
                    screen.clear()
                print(told if isinstance(told, str) else _in_words(told, live, time.monotonic() - began_s), flush=True)
            while not (stopped or files.changed()):
                time.sleep(POLL_S)
    return 0 if ok else 1


def _in_words(report: Report, live: LiveJob, took_s: float) -> str:
    from isel_twin.cam.fitting import in_words
    from isel_twin.jobs.checks.formats import as_words

    zero = "" if live.zero is None else f"zero of the work: {in_words(live.zero)}\n"
    return f"{as_words(report)}\n{zero}{many(live.played, 'line')} played in {took_s:.2f} s; Ctrl-C ends"


def _as_json(job: Path, told: Report | str) -> str:
    from json import dumps

    from isel_twin.jobs.checks.formats import as_json

    return dumps({"job": str(job), "ok": False, "error": told}) if isinstance(told, str) else as_json(told)
