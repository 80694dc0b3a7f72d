"""All golden sessions by name, and a look at one of them.

python -m tests.golden.sessions NAME ...             print sessions: actions, replies, first ticks, where all ended
python -m tests.golden.sessions --physics FILE       digests of the sessions with physics: written, or compared

`sessions.txt` keeps the digests of the kinematic ones, made on the code as it was when behaviour was last changed on
purpose (make golden). Those with physics contain the last bits of floating-point arithmetic, which another processor or
another version of MuJoCo or NumPy may change; so they are on no file of the repository. Before a change that is
to change nothing, write them to a file; after it, compare on the same machine.
"""

from __future__ import annotations

import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from golden.digest import FOLDER, load, save
from golden.fixed_sessions import SCRIPTS, fixed_session
from golden.random_sessions import random_session
from golden.session import Session, digest_of, play

FILE = FOLDER / "sessions.txt"
CONTROLLERS = ("c142", "imc-m", "imc-mp", "imc-s8", "ismif")
FEWER = ("bwo900", "external", "gmi99", "it116")
RANDOM = {"kinematic": 200, "mujoco": 12}
"""Random sessions of every controller on each plant; of those in FEWER a fifth."""
CHUNK = 20
"""Sessions in one test."""
FIRST_TICKS = 20


def names(plant: str = "kinematic") -> list[str]:
    """Names of all sessions on a plant: controller/plant/number, and fixed/plant/name."""
    fixed = [f"fixed/{plant}/{name}" for name in SCRIPTS]
    count = {**dict.fromkeys(CONTROLLERS, RANDOM[plant]), **dict.fromkeys(FEWER, RANDOM[plant] // 5)}
    return fixed + [f"{controller}/{plant}/{number:03}" for controller in count for number in range(count[controller])]


def session(name: str) -> Session:
    """The session of that name."""
    first, plant, rest = name.split("/", 2)
    return fixed_session(rest, plant) if first == "fixed" else random_session(first, plant, int(rest))


def chunks() -> dict[str, list[str]]:
    """Sessions in groups of similar ones, by the name of the group."""
    kinds: dict[str, list[str]] = {}
    for name in names():
        kinds.setdefault(name.rsplit("/", 1)[0], []).append(name)
    return {
        f"{kind}/{first:03}": members[first : first + CHUNK]
        for kind, members in kinds.items()
        for first in range(0, len(members), CHUNK)
    }


def show(name: str) -> None:
    """Print a session."""
    shown = session(name)
    print(f"{name}: Twin({', '.join(f'{key}={value!r}' for key, value in shown.options.items())})")
    if shown.scenario is not None:
        print(f"scenario:\n{shown.scenario}")
    for kind, *values in shown.actions:
        print(f"  {kind:<6}", *(repr(value) if isinstance(value, bytes) else value for value in values))
    played = play(shown)
    print("replies")
    for time_ns, data in played.replies:
        print(f"  {time_ns:>15} ns  {data!r}")
    t_ns, delta = np.asarray(played.steps.t_ns), np.asarray(played.steps.delta)
    print(f"{len(t_ns)} ticks")
    for time_ns, step in zip(t_ns[:FIRST_TICKS].tolist(), delta[:FIRST_TICKS].tolist(), strict=True):
        print(f"  {time_ns:>15} ns  {step}")
    print(f"counts {played.counts.tolist()}")
    print(f"position_mm {played.position_mm.tolist()}")
    print(f"digest {digest_of(shown)}{' (coarse)' if shown.coarse else ''}")


def physics(file: Path) -> int:
    """Write the digests of the sessions with physics to a file, or compare them with those there; the exit code."""
    seen = {name: digest_of(session(name)) for name in names("mujoco")}
    if not file.exists():
        save(file, seen)
        print(f"{len(seen)} sessions written to {file}")
        return 0
    differ = sorted(name for name, value in load(file).items() if seen.get(name) != value)
    print(f"{len(differ)} of {len(seen)} sessions differ", *differ, sep="\n  ")
    return 1 if differ else 0


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[1] == "--physics":
        sys.exit(physics(Path(sys.argv[2])))
    unknown = set(sys.argv[1:]) - set(names()) - set(names("mujoco"))
    if unknown or not sys.argv[1:]:
        sys.exit(f"{__doc__}\nno session {', '.join(sorted(unknown))}" if unknown else __doc__)
    for wanted in sys.argv[1:]:
        show(wanted)
