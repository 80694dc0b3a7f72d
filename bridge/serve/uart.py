"""Reception by a serial port with other settings than the sender, bit by bit as in a UART.

    line     ‾‾‾\\___/‾‾‾\\_______/‾‾‾ ...   start bit 0, data bits from the lowest, parity, stop bits 1; idle 1
    sample         ^   ^   ^   ^            the middle of each bit, in the receiver's own bit times from the edge on

The sender's bit i lasts from i/S to (i+1)/S, S being its speed. A receiver of speed R that has seen a falling edge at
e/S takes its sample j (0: start bit) at e/S + (j + 1/2)/R, that is, in the sender's bit

    e + floor(S (2j + 1) / (2R))                  (whole numbers: no rounding; on an edge the new level counts)

It samples the start bit (high: a spike, no byte), data bits, parity if it has one, and the first stop bit, then waits
for the next falling edge. Ports with different speeds work as long as the last sample stays in its bit: with 8N1
(sample 9 of 10 bits) for 9 <= 9.5 S/R < 10, so from 5.2 % too slow to 5.2 % too fast.

A low stop bit is a framing error, a line that was low throughout a break. The byte is still passed on, as by
microcontrollers and by operating systems in raw mode (without INPCK); errors are only counted. Sources: Maxim AN2141
for the sampling and its tolerance; termios(3) for errors.
"""

from __future__ import annotations

from dataclasses import dataclass

from isel_twin.controller import SerialFormat


@dataclass(frozen=True)
class Heard:
    """The result of reception."""

    data: bytes
    framing_errors: int  # bytes with a low stop bit, included in `data`
    parity_errors: int  # bytes with a wrong parity bit, included in `data`


def levels(data: bytes, form: SerialFormat) -> list[int]:
    """The line while `data` is sent without a pause: one level (0, 1) a bit time. Bits beyond the format's are lost."""
    line: list[int] = []
    for byte in data:
        bits = [byte >> number & 1 for number in range(form.data_bits)]
        line += [0, *bits, *_parity(bits, form.parity), *[1] * form.stop_bits]
    return line


def heard(data: bytes, sender: SerialFormat, receiver: SerialFormat) -> Heard:
    """Reception of `data` that `sender` sends without a pause on a line that is idle before and after."""
    line = levels(data, sender)
    found = bytearray()
    framing = parity = 0
    wanted = receiver.data_bits + (receiver.parity != "N")
    edge = _falling(line, 0)
    while edge < len(line):
        samples = [_sample(line, edge, number, sender, receiver) for number in range(wanted + 2)]
        last = 0
        if samples[0] == 0:
            bits = samples[1 : 1 + receiver.data_bits]
            found.append(sum(bit << number for number, bit in enumerate(bits)))
            parity += samples[1 + receiver.data_bits : -1] != _parity(bits, receiver.parity)
            framing += samples[-1] == 0
            last = wanted + 1
        edge = _falling(line, _place(edge, last, sender, receiver) + 1)
    return Heard(bytes(found), framing, parity)


def _place(edge: int, number: int, sender: SerialFormat, receiver: SerialFormat) -> int:
    return edge + sender.baud * (2 * number + 1) // (2 * receiver.baud)


def _sample(line: list[int], edge: int, number: int, sender: SerialFormat, receiver: SerialFormat) -> int:
    place = _place(edge, number, sender, receiver)
    return line[place] if place < len(line) else 1


def _falling(line: list[int], first: int) -> int:
    """The first bit from `first` on that begins with a falling edge; the line's length if there is none."""
    for place in range(first, len(line)):
        if line[place] == 0 and (place == 0 or line[place - 1] == 1):
            return place
    return len(line)


def _parity(bits: list[int], kind: str) -> list[int]:
    """The parity bit, if there is one: even, odd, mark or space."""
    if kind == "N":
        return []
    return [{"E": sum(bits) & 1, "O": ~sum(bits) & 1, "M": 1, "S": 0}[kind]]
