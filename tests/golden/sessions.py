"""All golden sessions by name, and a look at one of them.

python -m tests.golden.sessions NAME ...     print sessions: actions, replies, first ticks, where everything ended

`sessions.txt` keeps their digests, made on the code as it was when behaviour was last changed on purpose (make golden).
Those with physics contain the last bits of MuJoCo's arithmetic: another version of it, or of NumPy or Numba, may change
all of them at once, while the kinematic ones stay.
"""

from __future__ import annotations

import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from golden.digest import FOLDER
from golden.fixed_sessions import PLANTS, SCRIPTS, fixed_session
from golden.random_sessions import random_session
from golden.session import Session, digest_of, play

FILE = FOLDER / "sessions.txt"
CONTROLLERS = ("c142", "imc-m", "imc-mp", "imc-s8", "ismif")
RANDOM = {"kinematic": 200, "mujoco": 12}
"""Random sessions of every controller on each plant."""
CHUNK = {"kinematic": 20, "mujoco": 10}
"""Sessions in one test."""
FIRST_TICKS = 20


def names() -> list[str]:
    """Names of all sessions: controller/plant/number, and plant/name for the fixed ones."""
    fixed = [f"fixed/{plant}/{name}" for plant in PLANTS for name in SCRIPTS]
    return fixed + [
        f"{controller}/{plant}/{number:03}"
        for plant, count in RANDOM.items()
        for controller in CONTROLLERS
        for number in range(count)
    ]


def session(name: str) -> Session:
    """The session of that name."""
    first, plant, rest = name.split("/", 2)
    return fixed_session(rest, plant) if first == "fixed" else random_session(first, plant, int(rest))


def chunks() -> dict[str, list[str]]:
    """Sessions in groups of similar ones, by the name of the group."""
    kinds: dict[str, list[str]] = {}
    for name in names():
        kinds.setdefault(name.rsplit("/", 1)[0], []).append(name)
    size = {kind: CHUNK[kind.rsplit("/", 1)[1]] for kind in kinds}
    return {
        f"{kind}/{first:03}": members[first : first + size[kind]]
        for kind, members in kinds.items()
        for first in range(0, len(members), size[kind])
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


if __name__ == "__main__":
    unknown = set(sys.argv[1:]) - set(names())
    if unknown or not sys.argv[1:]:
        sys.exit(f"{__doc__}\nno session {', '.join(sorted(unknown))}" if unknown else __doc__)
    for wanted in sys.argv[1:]:
        show(wanted)
