"""Host, inputs and clock: implements `isel_twin.controller.Controller`.

    bytes -> link.py -> own address: short records here, long ones by the table of commands.py
                        address of a drive (0..63): the drives answer, through the card

Everything that takes time continues in `_settle`, after every call.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Literal

from isel_twin.base.parameters import Limits
from isel_twin.controller import DriveInput, Drives, Event, Key, KeyValue, Reply, SerialFormat
from isel_twin.firmware.gmi99 import images, link, queries
from isel_twin.firmware.gmi99.commands import Kind, command_of, parse
from isel_twin.firmware.gmi99.device import OUTPUT_NAMES, Card
from isel_twin.firmware.gmi99.drives import TERMINALS, TURN
from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError
from isel_twin.firmware.gmi99.link import ACKNOWLEDGED, LOADER, Dil, Frame, Receiver, long_record, short_record
from isel_twin.firmware.gmi99.sequencer import Sequencer
from isel_twin.firmware.gmi99.settings import SLOTS, Stored
from isel_twin.motion import SetPointRun

BUFFER_FULL = 0x08
ABORT, STATUS, SPINDLE_SPEED, OVERRIDE = 0, 1, 8, 9
DRIVE_VERSION = 550
OVERRIDE_LIMIT = 125
EMPTY = Stored()  # a card from the factory


class Gmi99:
    """Implements isel_twin.controller.Controller, UsesDrives, NamesOutputs and HasKeys."""

    direction = (1,) * SLOTS
    output_names: Sequence[str] = OUTPUT_NAMES
    keys: Mapping[str, Key] = MappingProxyType(
        {"override": Key("the potentiometer; after o1", Limits("%", 0, OVERRIDE_LIMIT, whole=True))}
    )

    def __init__(
        self,
        flash: bytes | None,
        dil: Dil,
        *,
        parity: Literal["N", "E"] = "E",
        override_pot_percent: int = 100,
        turn: int = TURN,
        new: Stored = EMPTY,
    ) -> None:
        self._dil = dil
        self._parity = parity
        self._card = Card(flash, override_pot_percent, turn, new)
        self._card.store.restore(parse)
        self._sequencer = Sequencer(self._card)
        self._receiver = Receiver(dil.variant, from_host=True)
        self._heard_ns = 0

    # ---- state ------------------------------------------------------------------------------------------------------

    @property
    def serial_format(self) -> SerialFormat:
        return SerialFormat(self._dil.baud, parity=self._parity)

    @property
    def counts(self) -> tuple[int, ...]:
        return self._card.counts

    @property
    def run(self) -> SetPointRun | None:
        return self._card.run

    @property
    def next_ns(self) -> int | None:
        card = self._card
        reference = card.queue.next_ns
        drives = card.drives_run.end_ns if card.drives_run is not None and reference is None else None
        all_times = card.interpolator.next_ns, card.off_path.next_ns, reference, drives, card.plc.next_ns
        times = [t for t in all_times if t is not None]
        return max(min(times), card.now_ns) if times else None

    @property
    def idle(self) -> bool:
        return not (self._card.busy or self._card.off_path.working)

    @property
    def fault(self) -> bool:
        return bool(self.fault_cause)

    @property
    def fault_cause(self) -> str:
        return self._card.fault_cause

    # ---- inputs -----------------------------------------------------------------------------------------------------

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self._card.power_on(t_ns, levels)

    def receive(self, t_ns: int, data: bytes) -> None:
        if t_ns - self._heard_ns > link.GAP_NS:
            self._receiver.expire()
        self.advance(t_ns)
        self._heard_ns = t_ns
        if self._dil.address == LOADER:
            return
        for piece in self._receiver.take(data):
            if isinstance(piece, Frame):
                if piece.address == self._dil.address:
                    self._own(piece)
                else:
                    self._through(piece)
                self._settle()

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        self._card.now_ns = t_ns
        self._card.drives.set_input(terminal, level)
        self._card.interpolator.speeds_changed()
        self._settle()

    @property
    def key_values(self) -> Mapping[str, KeyValue]:
        return {"override": self._card.pot_percent}

    def press(self, t_ns: int, name: str, value: KeyValue) -> None:
        self._card.now_ns = t_ns
        self._card.pot_percent = int(value)
        self._card.interpolator.speeds_changed()
        self._settle()

    def advance(self, t_ns: int) -> None:
        self._card.now_ns = t_ns
        self._settle()

    def take(self) -> list[Event]:
        events, self._card.events = self._card.events, []
        return events

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        return TERMINALS

    def machine_overrides(self) -> Mapping[str, Any]:
        return {"axes.all.drive": "servo"}

    def drive_inputs(self) -> Sequence[DriveInput]:
        return self._card.drives.drive_inputs()

    def use_drives(self, drives: Drives) -> None:
        self._card.drives.asked = drives

    # ---- progress ---------------------------------------------------------------------------------------------------

    def _settle(self) -> None:
        card = self._card
        card.interpolator.advance()
        card.off_path.advance()
        card.drives.advance()
        if card.plc.next_ns is not None and card.plc.next_ns <= card.now_ns:
            ran = card.images.flag(images.PROGRAM_RUNS)
            card.refresh_flags()
            card.ask_drives()
            card.plc.advance(card.now_ns)
            card.flags_changed(program_ran=ran)
        self._sequencer.pump()
        card.send_motions()
        card.refresh_flags()
        card.plc.look(card.now_ns)

    # ---- records to the card ----------------------------------------------------------------------------------------

    def _own(self, frame: Frame) -> None:
        if frame.short:
            self._short(frame)
            return
        instruction = parse(frame.command, frame.content)
        if instruction is None:
            return
        kind = command_of(instruction).kind(instruction)
        if instruction.code == ord("T"):
            self._query(instruction)
        elif kind is Kind.IMMEDIATE and not (instruction.code == ord("p") and self._card.queue.recording):
            self._reply(ACKNOWLEDGED)
            try:
                command_of(instruction).run(self._card, instruction)
            except OutOfRangeError as error:
                self._card.refuse(str(error))
        elif self._sequencer.full(instruction):
            self._reply(self._record(BUFFER_FULL))
        else:
            self._reply(ACKNOWLEDGED)
            if instruction.code == ord("Q"):
                self._card.refused = ""
            self._sequencer.put(bytes([frame.command]) + frame.content, instruction)

    def _short(self, frame: Frame) -> None:
        card = self._card
        if frame.command == STATUS:
            self._status()
            return
        self._reply(ACKNOWLEDGED)
        if frame.command == ABORT:
            card.abort()
            card.refused, card.store.error = "", False
        elif frame.command == SPINDLE_SPEED:
            card.interpolator.spindle_rpm = int.from_bytes(frame.content, "little")
            card.interpolator.speeds_changed()
        elif frame.command == OVERRIDE:
            percent = frame.content[0]
            if percent > OVERRIDE_LIMIT:
                card.refuse(f"an override of {percent} %; at most {OVERRIDE_LIMIT} %")
            else:
                card.override_given, card.override_external = None, percent
                card.set(override=1)
                card.interpolator.speeds_changed()

    def _query(self, instruction: Instruction) -> None:
        answer = queries.answer(self._card, instruction)
        if answer == queries.STATUS:
            self._status()
        elif answer is not None:
            self._reply(long_record(self._dil.variant, self._dil.address, answer))

    def _status(self) -> None:
        """The status record; the message of MB4 goes with it, once."""
        card = self._card
        message = card.images.flags[images.MESSAGE]
        card.images.flags[images.MESSAGE] = 0
        information = card.information | (2 if message else 0)
        self._reply(self._record(information, bytes([message]) if message else b""))

    def _record(self, information: int, extension: bytes = b"") -> bytes:
        return short_record(self._dil.variant, self._dil.address, information, extension)

    def _reply(self, data: bytes) -> None:
        self._card.events.append(Reply(data))

    # ---- records to drives ------------------------------------------------------------------------------------------

    def _through(self, frame: Frame) -> None:
        """Pass a record to a drive, if it exists and the list of N18 allows it."""
        listed = self._card.settings.addresses
        slot = frame.address
        if slot >= SLOTS or (listed and slot not in listed):
            return
        if frame.short and frame.command == STATUS:
            self._reply(short_record(self._dil.variant, slot, self._card.drives.information(slot)))
        elif not frame.short and chr(frame.command) == "T":
            self._drive_query(slot, frame)
        else:
            self._reply(ACKNOWLEDGED)
            if not frame.short and chr(frame.command) == "Q" and frame.content[:1] in (b"\x01", b"\x03"):
                self._sequencer.put_drive(slot, run=frame.content[:1] == b"\x01")

    def _drive_query(self, slot: int, frame: Frame) -> None:
        answer = b""
        if (instruction := parse(frame.command, frame.content)) is None:
            return
        if instruction.p1 == 0:
            answer = queries.position(self._card, slot, self._card.drives.encoder(slot))
        elif (instruction.p1, instruction.p2) == (1, 0):
            answer = b"V" + DRIVE_VERSION.to_bytes(2, "little")
        if answer:
            self._reply(long_record(self._dil.variant, slot, answer))
