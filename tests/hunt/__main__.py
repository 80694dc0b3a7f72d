"""The hunt: python -m tests.hunt [--seeds N | --seeds FIRST:LAST | --seed N] [--jobs N]

--seed N     one world: what is drawn, everything that was done and when, and what is wrong
--seeds ...  so many worlds (seeds 0 .. N-1, or FIRST .. LAST-1) on all cores; one line for each that failed
"""

from __future__ import annotations

import argparse
import faulthandler
import os
import signal
import sys
from collections.abc import Iterable
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from hunt.play import Action, Failure, hunt
from hunt.world import draw_world

SEEDS = 1000
HANGS_S = 900.0
"""Wall time after which a process that does not even count its computing time is ended, with a traceback."""
SHOWN = 120
"""Bytes of one write in a report."""


def hunt_one(seed: int) -> Failure | None:
    """One seed in a process of its own, which leaves Ctrl-C to the one that has started it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    faulthandler.dump_traceback_later(HANGS_S, exit=True)
    try:
        return hunt(seed)
    finally:
        faulthandler.cancel_dump_traceback_later()


def main(arguments: list[str]) -> int:
    """Exit code: 0 if nothing was found, 1 otherwise, 2 for a bad call."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.hunt", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, help="one world, shown in full")
    parser.add_argument("--seeds", default=str(SEEDS), help=f"so many, or FIRST:LAST; {SEEDS} if not given")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes; all cores if not given")
    call = parser.parse_args(arguments)
    if call.seed is not None:
        return show(call.seed)
    first, _, last = str(call.seeds).rpartition(":")
    return hunt_all(range(int(first or 0), int(last)), max(call.jobs, 1))


def hunt_all(seeds: range, jobs: int) -> int:
    """Hunt through seeds in so many processes; print what is found."""
    console = Console(soft_wrap=True, highlight=False)
    failures: list[str] = []
    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with (
        Progress(*columns, TimeRemainingColumn(), console=console) as progress,
        ProcessPoolExecutor(jobs) as pool,
    ):
        task = progress.add_task("nothing found", total=len(seeds))
        futures = {pool.submit(hunt_one, seed): seed for seed in seeds}
        played = 0
        try:
            for seed, line in results(futures):
                played += 1
                if line:
                    failures.append(line)
                    progress.print(line, markup=False)
                progress.update(task, advance=1, description=f"{len(failures) or 'nothing'} found (seed {seed})")
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
    kinds = f"{len(failures)} of them failed" if failures else "nothing found"
    console.print(f"{played} seeds of {seeds.start} to {seeds.stop - 1}: {kinds}")
    return 1 if failures or played < len(seeds) else 0


def results(futures: dict[Future[Failure | None], int]) -> Iterable[tuple[int, str]]:
    """Seed and failure, "" for none, of each world as it is done."""
    for future in as_completed(futures):
        seed = futures[future]
        try:
            failure = future.result()
        except BrokenProcessPool:
            yield seed, f"seed {seed}: not done, a process has died; python -m tests.hunt --seed {seed}"
        else:
            yield seed, "" if failure is None else str(failure)


def show(seed: int) -> int:
    """Play one world and print all of it."""
    print(draw_world(seed))
    failure = hunt(seed)
    if failure is None:
        print("nothing found")
        return 0
    for at_ns, action in failure.actions:
        print(f"{at_ns:>15}  {shown(action)}")
    print(failure)
    return 1


def shown(action: Action) -> str:
    """An action in a report."""
    if action[0] != "write":
        return " ".join(map(str, action))
    data = action[1]
    return f"write {data!r}" if len(data) <= SHOWN else f"write {data[:SHOWN]!r} ... {len(data)} bytes"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
