"""Commands that set something, wait for something, or make the axes ready: rows of commands.py.

Every handler gets the card and the instruction. It raises OutOfRangeError for wrong parameters before it changes
anything.
"""

from __future__ import annotations

from collections.abc import Generator

from isel_twin.firmware.gmi99 import images
from isel_twin.firmware.gmi99.device import Card
from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError, require_place, signed
from isel_twin.firmware.gmi99.interpolator import OntoSwitchError
from isel_twin.firmware.gmi99.settings import HIGHEST, LOWEST, NUMBERS, RATIO_ONE, SLOTS, Settings
from isel_twin.firmware.gmi99.waiting import Wait

TOP_SPEED_HZ = 5, 1_000_000
ACCELERATION_HZ_PER_MS = 1, 30_000
SAVE = 85, 170
INACTIVE_OVERRIDE = 0, 100


def within(name: str, value: int, low: int, high: int) -> int:
    if not low <= value <= high:
        raise OutOfRangeError(f"{name} is {value}; it must lie in {low} .. {high}")
    return value


def axis_of(name: str, value: int) -> int:
    return within(name, value, 0, SLOTS - 1)


def no_action(card: Card, instruction: Instruction) -> None:
    """No action: queries.py answers."""


def move(card: Card, instruction: Instruction) -> None:
    """`V` and 80h + mask: a straight move, or a part of a circle."""
    try:
        card.interpolator.move(instruction, from_host=not card.in_program)
    except OntoSwitchError as error:
        card.drives.lose(str(error), stages=False)


# ---- speeds ----------------------------------------------------------------------------------------------------------


def _per_axis(card: Card, name: str, value: int, slot: int) -> None:
    """Set a value of all axes by the leading one (slot 0), or of one axis (slot + 1)."""
    within("P2", slot, 0, SLOTS)
    old = getattr(card.settings, name)
    new = (value,) * (SLOTS + 1) if slot == 0 else (*old[:slot], value, *old[slot + 1 :])
    card.set(**{name: new})


def acceleration(card: Card, instruction: Instruction) -> None:
    _per_axis(card, "b_hz_per_ms", within("B", instruction.p1, *ACCELERATION_HZ_PER_MS), instruction.p2)


def top_speed(card: Card, instruction: Instruction) -> None:
    """`M`: top speed and rapid; the reduced speed becomes 0."""
    _per_axis(card, "m_hz", within("M", instruction.p1, *TOP_SPEED_HZ), instruction.p2)
    card.set(r_hz=(0,) * (SLOTS + 1))


def reduced_speed(card: Card, instruction: Instruction) -> None:
    """`R`: reduced speed, at most M."""
    value = within("R", instruction.p1, *TOP_SPEED_HZ)
    within("P2", instruction.p2, 0, SLOTS)
    _per_axis(card, "r_hz", min(value, card.settings.m_hz[instruction.p2]), instruction.p2)
    card.interpolator.speeds_changed()


def feed(card: Card, instruction: Instruction) -> None:
    """`f`: speed of the moves that follow; M if it is above."""
    if instruction.p1 == 0:
        raise OutOfRangeError("f is 0; it must be at least 1")
    card.interpolator.feed_hz = min(instruction.p1, card.settings.m_hz[0])


def override(card: Card, instruction: Instruction) -> None:
    """`o`: override off, on, or on with a value in place of the potentiometer (immediate)."""
    within("P1", instruction.p1, 0, 2)
    if instruction.p1 == 2:
        card.override_given = within("P2", instruction.p2, *INACTIVE_OVERRIDE)
        card.set(override=1)
    else:
        if instruction.p1 == 1:
            card.override_given = None  # the potentiometer or the external value acts again
        card.set(override=instruction.p1)
    card.interpolator.speeds_changed()


def tool_speed(card: Card, instruction: Instruction) -> None:
    """`W`: tool speed control off or on; resolution and influence of one axis."""
    on, value, slot = instruction.values
    within("P1", on, 0, 1)
    if slot:
        axis = within("P3", slot, 1, SLOTS) - 1
        apart = value > RATIO_ONE
        ratio = within("P2", value - (RATIO_ONE + 1 if apart else 0), 1, RATIO_ONE)
        card.set(
            ratios=_with(card.settings.ratios, axis, ratio),
            no_influence=_with(card.settings.no_influence, axis, int(apart)),
        )
    card.set(tool_speed=on)


def _with(values: tuple[int, ...], index: int, value: int) -> tuple[int, ...]:
    return (*values[:index], value, *values[index + 1 :])


# ---- parameters ------------------------------------------------------------------------------------------------------


def parameter(card: Card, instruction: Instruction) -> None:
    """`N`: parameter P2 (slot in P2 or P3) becomes P1."""
    value, index, third = instruction.values
    if index & 0xFE == 8 and index >> 8 < SLOTS:
        name = "home_to" if index & 1 else "home_from"
        card.set(**{name: _with(getattr(card.settings, name), index >> 8, signed(value))})
    elif index == 18:
        off = value == 0xFFFFFF and third == 0xFFFFFF
        card.set(addresses=() if off else tuple(value.to_bytes(3, "little") + third.to_bytes(3, "little")))
    elif index == 40:
        card.set(per_turn=_with(card.settings.per_turn, axis_of("P3", third), within("N40", value, 0, HIGHEST)))
    elif index in NUMBERS:
        name, low, high = NUMBERS[index]
        card.set(**{name: within(f"N{index}", signed(value) if low < 0 else value, low, high)})
        settings = card.settings
        if settings.fs90_hz > settings.fs0_hz:
            card.set(fs90_hz=settings.fs0_hz)
        card.parameters_changed()
    else:
        raise OutOfRangeError(f"there is no parameter N{index}")


def parameter_value(settings: Settings, index: int, slot: int) -> int | None:
    """Value of an N parameter, of a slot where it has several; None if there is none."""
    if index & 0xFE == 8 and index >> 8 < SLOTS:
        return (settings.home_to if index & 1 else settings.home_from)[index >> 8]
    if index == 18:
        return int.from_bytes(bytes(settings.addresses[:3] or (255, 255, 255)), "little")
    if index == 40:
        return settings.per_turn[slot] if slot < SLOTS else None
    if index in NUMBERS:
        return int(getattr(settings, NUMBERS[index][0]))
    return None


def save(card: Card, instruction: Instruction) -> None:
    if (instruction.p1, instruction.p2) != SAVE:
        raise OutOfRangeError("s wants 85 and 170")
    card.keep(settings=card.settings.kept)


def reset(card: Card, instruction: Instruction) -> None:
    """`r`: defaults; with P3 = 1 all memories are erased."""
    card.settings = Settings()
    card.parameters_changed()
    if instruction.p3 == 1:
        card.erase()


def duplicate(card: Card, instruction: Instruction) -> None:
    """Axis duplication: the target makes all motions of the source; -1 ends it."""
    target, source = axis_of("P1", instruction.p1), signed(instruction.p2)
    within("P2", source, -1, target - 1)
    card.interpolator.sources[target] = source


# ---- data ------------------------------------------------------------------------------------------------------------


def register(card: Card, instruction: Instruction) -> None:
    card.images.set_register(within("P2", instruction.p2, 0, images.REGISTERS - 1), signed(instruction.p1))
    card.keep_data()


def data_word(card: Card, instruction: Instruction) -> None:
    """`d`: a data word at a byte offset."""
    word, offset = within("P1", instruction.p1, 0, 0xFFFF), within("P2", instruction.p2, 0, 254)
    card.images.set_data_word(offset, word)
    card.keep_data()


def report_again(card: Card, instruction: Instruction) -> None:
    card.images.set_flag(images.REPORT_AGAIN, True)


# ---- waiting for the PLC ---------------------------------------------------------------------------------------------


def m_function(card: Card, instruction: Instruction) -> Generator[Wait, None, None]:
    """`m`: ask the PLC for an M, S or T function, and wait until it has cleared the request."""
    number, second, third = instruction.values
    flags = card.images.flags
    if number == 100:
        place = images.SPINDLE, 7
        flags[images.SPINDLE_SPEED : images.SPINDLE_SPEED + 2] = (third & 0xFFFF).to_bytes(2, "little")
        flags[images.SPINDLE] = second & 0x7F
    elif number == 101:
        place = images.TOOL, 7
        flags[images.TOOL] = second & 0x7F
    else:
        index = within("P1", number, 50, 89) - 50
        place = images.FIRST_M + index // 8, index % 8
        flags[images.M_EXTENSION] = second & 0xFF
    card.images.set_flag(place, True)
    try:
        yield Wait(until=lambda: not card.images.flag(place))
    finally:
        card.images.set_flag(place, False)


# ---- axes ------------------------------------------------------------------------------------------------------------


def set_position(card: Card, instruction: Instruction) -> None:
    """`O`: the position counter becomes P1, active offsets included."""
    axis = axis_of("P2", instruction.p2)
    if card.uncoupled >> axis & 1:
        raise OutOfRangeError("O of an axis that has left the interpolation (p4)")
    value = within("P1", signed(instruction.p1), LOWEST, HIGHEST) + card.offsets.total(axis)
    require_place(axis, value)
    card.set_counter(axis, value)


def auxiliary(card: Card, instruction: Instruction) -> Generator[Wait, None, None]:
    """`H`: wait until axes are in position; put rotary axes into a segment of the circle."""
    what, second, mask = instruction.values
    if what == 2:
        card.images.set_flag(images.WAITS_FOR_POSITION, True)
        try:
            yield from card.drives.in_position(mask & 0x3F or 0x3F)
        finally:
            card.images.set_flag(images.WAITS_FOR_POSITION, False)
    elif what == 12:
        low, middle = second & 0xFF, second >> 8 & 0xFF
        segment = low - 256 if low & 0x80 else low
        if middle & 0x80:
            axes, segment = [axis for axis in range(SLOTS) if middle >> axis & 1], 0
        else:
            axes = [axis_of("P2M", middle)]
        turns = [card.settings.per_turn[axis] for axis in axes]
        if not all(turns):
            raise OutOfRangeError("H12 wants the increments of a turn (N40)")
        places = {axis: card.position[axis] % turn + segment * turn for axis, turn in zip(axes, turns, strict=True)}
        for axis, place in places.items():
            require_place(axis, place)
        for axis, place in places.items():
            card.set_counter(axis, place)
    else:
        raise OutOfRangeError(f"there is no H{what}")


def reference(card: Card, instruction: Instruction) -> Generator[Wait, None, None]:
    """`Q`: counters to 0 where the axes stand, or a reference run; then the indexer is ready if all drives are."""
    mask = instruction.p1 & 0x3F
    within("P2", instruction.p2, 0, 1)
    yield from card.drives.make_ready(mask, run=instruction.p2 == 1)
