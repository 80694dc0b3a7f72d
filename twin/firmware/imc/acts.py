"""What the iMC's commands make the machine do, and the numbers that it keeps without power."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from isel_twin.firmware.imc import commands, grammar
from isel_twin.firmware.imc.profile import Profile
from isel_twin.firmware.imc.reading import ReadingState, numbers
from isel_twin.language import Act, FlashSetting

STOPS = bytes((grammar.STOP, grammar.BREAK))
STRAIGHT = frozenset("AM")  # pairs of steps and speed (2.2.2, 2.2.18)
OTHER_MOTIONS = frozenset("wyZSF")  # helix, arc, until a port, stored program, running free
DIGITS = 6  # of a counter in the reply to `@0P`, 24 bits in two's complement (2.2.21)


def act(sent: bytes) -> Act:
    """Of one message of the host, without the state of the session: for device number 0."""
    if len(sent) == 1:
        return Act(stops=sent in STOPS)
    parts = ReadingState().split(sent.replace(b"\n", b"").removesuffix(b"\r"))
    code, text = parts or ("", "")
    if code == "R":
        return Act((), references=next(iter(numbers(text) or ()), 0))
    if code in STRAIGHT:
        return Act(tuple((numbers(text) or [])[1::2]))
    return Act(() if code in OTHER_MOTIONS else None)


def counters(sent: bytes, reply: bytes) -> tuple[Mapping[int, int], bytes] | None:
    parts = ReadingState().split(sent.replace(b"\n", b"").removesuffix(b"\r"))
    if parts is None or parts[0] != "P" or len(reply) < 1 + DIGITS:
        return None
    try:
        words = [int(reply[at : at + DIGITS], 16) for at in range(1, len(reply) - DIGITS + 1, DIGITS)]
    except ValueError:
        return None
    half = 1 << 4 * DIGITS - 1
    return {axis: (word ^ half) - half for axis, word in enumerate(words)}, reply[:1]


def flash_settings(profile: Profile) -> Mapping[str, FlashSetting]:
    """`@0IJ`, `@0Ij`, `@0Id` for all axes (4.2.4, 4.2.3, 4.2.1)."""
    ramp, start = commands.ACCELERATION, commands.START_STOP_HZ
    speeds = profile.min_speed_hz, profile.max_speed_hz, profile.reference_hz[0]
    found = {
        "acceleration": FlashSetting("@0IJ{}", ramp.low, ramp.high, profile.acceleration_hz_per_ms, "Hz/ms"),
        "start-stop frequency": FlashSetting("@0Ij{}", start.low, start.high, profile.start_stop_hz, "Hz"),
        "reference speed": FlashSetting("@0Id{0},{0},{0}", *speeds, "Hz", of_references=True),
    }
    known = "Id" not in profile.unknown_commands
    return {name: one for name, one in found.items() if known or not one.of_references}


def flash_lines(profile: Profile, values: Mapping[str, int]) -> Sequence[str]:
    """`@0Id` needs the axes, and `@0IW` keeps all of it (4.2.18)."""
    known = flash_settings(profile)
    return ["@07", *(known[name].command.format(value) for name, value in values.items()), "@0IW"]
