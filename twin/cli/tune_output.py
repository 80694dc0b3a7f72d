"""Output of `isel-twin tune`: JSON for programs, a table for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from isel_twin.base.errors import one_line
from isel_twin.cli.outputs import many, progress, say, say_json, terminals

if TYPE_CHECKING:
    from isel_twin.many.tuning import Judgement, Tuned
    from isel_twin.many.tuning.result import Tried
    from isel_twin.many.tuning.study import Study


class Output:
    """Shows the progress of a study."""

    def begun(self, study: Study) -> None:
        """After the references are judged; `study.tried` has the trials of earlier calls."""

    def tried(self, tried: Tried) -> None: ...

    def puts_together(self) -> None:
        """Before the best settings of each move are combined."""

    def mended(self, why: str) -> None:
        """The combination failed, for this reason, and is corrected next."""

    def confirms(self, tried: Tried) -> None:
        """Before a setting is confirmed on further machines."""

    def confirmed(self, repetition: Judgement) -> None: ...

    def fell(self, tried: Tried, why: str) -> None: ...

    def over(self, job: Path, study: Study, found: Tuned | None, stopped: bool, files: Sequence[Path]) -> None:
        """At the end. files: written if a setting was found."""


class Json(Output):
    """One line a trial and one for the summary."""

    def begun(self, study: Study) -> None:
        for tried in study.tried:
            self.tried(tried)

    def tried(self, tried: Tried) -> None:
        say_json(_told(tried.number, tried))

    def mended(self, why: str) -> None:
        say_json({"trial": None, "not_confirmed": why})

    def fell(self, tried: Tried, why: str) -> None:
        say_json({"trial": tried.number, "not_confirmed": why})

    def over(self, job: Path, study: Study, found: Tuned | None, stopped: bool, files: Sequence[Path]) -> None:
        written = [str(file) for file in files] if found is not None else []
        say_json({**_summary(study, found), "interrupted": stopped, "written": written})


class Table(Output):
    """Each improvement as it is found, and a line of progress on a terminal. A context manager."""

    def __init__(self, trials: int, confirm: int) -> None:
        from rich.progress import TimeRemainingColumn

        self._trials, self._confirm = trials, confirm
        out, messages = terminals()
        self._progress = progress(
            out if out.is_terminal else messages,
            TimeRemainingColumn,
            redirect_stdout=out.is_terminal,  # output to a file must not be redirected
            redirect_stderr=messages.is_terminal,
        )
        self._task = self._progress.add_task("job as it stands", total=trials)
        self._seen: list[Tried] = []

    def __enter__(self) -> Table:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def begun(self, study: Study) -> None:
        problem, had = study.problem, study.tried
        what = f"{many(len(problem.parameters), 'parameter')} for {many(len(problem.moves), 'move')}"
        print(f"{what}; moves at {problem.rapid_from_hz} Hz or more are rapid", flush=True)
        for what, name in (("as it stands", "job as it stands"), ("defaults", "controller's defaults")):
            judgement = study.reference(what)
            if judgement is not None:
                print(f"{name:<22} {_words(judgement)}", flush=True)
        if had:
            print(f"continues after {many(len(had), 'trial')}", flush=True)
        self._seen = list(had)
        self._progress.update(self._task, completed=len(had), description="trials")

    def tried(self, tried: Tried) -> None:
        from isel_twin.many.tuning.front import in_words
        from isel_twin.many.tuning.result import front

        self._seen.append(tried)
        best = front(self._seen)
        if tried in best:
            print(f"trial {tried.number:<16} {_words(tried.judgement)}  {in_words(tried.values)}", flush=True)
        fastest = f": best {best[0].judgement.time_s:.2f} s" if best else ""
        self._progress.update(self._task, completed=len(self._seen), description=f"trials{fastest}")

    def puts_together(self) -> None:
        self._progress.update(self._task, description="combines the best of each move", total=None)

    def mended(self, why: str) -> None:
        print(f"the best of each move, combined, fails and is corrected: {why}", flush=True)

    def confirms(self, tried: Tried) -> None:
        doing = f"confirms trial {tried.number}"
        print(f"{doing} on {many(self._confirm, 'new machine')}", flush=True)
        self._progress.update(self._task, description=doing, total=self._confirm, completed=0)

    def confirmed(self, repetition: Judgement) -> None:
        self._progress.advance(self._task)

    def fell(self, tried: Tried, why: str) -> None:
        print(f"trial {tried.number} fails: {why}", flush=True)

    def over(self, job: Path, study: Study, found: Tuned | None, stopped: bool, files: Sequence[Path]) -> None:
        from isel_twin.many.tuning.front import rows

        self._progress.stop()
        before = study.reference("as it stands")
        if before is not None:
            print()
            table = [("trial", "time / s", "saved", "margin", "settings")]
            table += rows(study.tried, before, None if found is None else found.tried.number)
            for trial, time_s, saved, margin, settings in table:
                print(f"{trial:>6}{time_s:>11}{saved:>9}{margin:>9}  {settings}")
            print()
        if stopped:
            say(f"{job}: interrupted after {len(study.tried)} of {self._trials} trials; the same command continues")
        elif found is None:
            say(f"{job}: no setting keeps the margin on all machines; a smaller --margin, or more --trials, may")
        else:
            _print_found(found, study, files)


def _print_found(found: Tuned, study: Study, files: Sequence[Path]) -> None:
    from isel_twin.jobs.robust import at_most
    from isel_twin.jobs.uncertain import coverage
    from isel_twin.many.tuning.result import ALONE

    told, held = _summary(study, found), found.held
    saved = [
        f", {100.0 * told[key]:.1f} % less than {what}"
        for key, what in (("saved", "the job as it stands"), ("saved_against_defaults", "the defaults"))
        if told[key] is not None
    ]
    line = found.tried.judgement.line
    print(f"tuned: {found.tried.judgement.time_s:.3f} s{''.join(saved)}{f'; {line}' if line else ''}")
    print(
        f"margin: at least {100.0 * held.margin:.1f} % on {many(held.made, 'new machine')}, "
        f"{100.0 * held.nearly_all:.1f} % on {100 - ALONE} % of them; no steps lost: "
        f"at most {100.0 * at_most(held.lost, held.made):.1f} % of such machines lose steps (95 %)"
    )
    torque, weakest = (100.0 * share for share in (found.tried.judgement.torque, found.tried.judgement.weakest))
    print(f"torque: {torque:.1f} % left in its trial, {weakest:.1f} % where motors are as weak as their bands say")
    if found.may_be:
        print(f"as far as this machine is known ({coverage(study.problem.uncertain):.0%}):")
        print(*(f"  {one.in_words()}" for one in found.may_be), sep="\n")
    print(f"written: {', '.join(map(str, files))}")
    if found.permanent:
        print(f"to keep its ramps in the controller, send: {'  '.join(found.permanent)}")


def _summary(study: Study, found: Tuned | None) -> dict[str, Any]:
    from isel_twin.jobs.robust import at_most
    from isel_twin.many.tuning.result import PUT_TOGETHER, as_json, front, gain

    as_it_stands, defaults = study.reference("as it stands"), study.reference("defaults")
    told: dict[str, Any] = {
        "summary": True,
        "found": found is not None,
        "trials": len(study.tried),
        "pruned": sum(not tried.judgement.good for tried in study.tried),
        "as_it_stands": None if as_it_stands is None else as_json(as_it_stands),
        "defaults": None if defaults is None else as_json(defaults),
        "front": [_told(one.number, one) for one in front(study.tried)],
    }
    if found is not None:
        held, time_s = found.held, found.tried.judgement.time_s
        number = None if found.tried.number == PUT_TOGETHER else found.tried.number
        told["tuned"] = _told(number, found.tried)
        told["permanent"] = list(found.permanent)
        told["confirmed"] = {
            "repetitions": held.made, "lost": held.lost, "margin": round(held.margin, 4),
            "margin_of_95_percent": round(held.nearly_all, 4), "at_most": round(at_most(held.lost, held.made), 4),
        }  # fmt: skip
        if found.may_be:
            told["uncertain"] = [one.told() for one in found.may_be]
        for key, before in (("saved", as_it_stands), ("saved_against_defaults", defaults)):
            told[key] = round(gain(time_s, before.time_s), 6) if before is not None and before.good else None
    return told


def _told(number: int | None, tried: Tried) -> Mapping[str, Any]:
    from isel_twin.many.tuning.result import as_json

    return {"trial": number, "values": dict(tried.values), **as_json(tried.judgement)}


def _words(judgement: Judgement) -> str:
    if not judgement.good:
        return one_line(judgement.why)
    return f"{judgement.time_s:>9.3f} s {100.0 * judgement.margin:5.1f} %"
