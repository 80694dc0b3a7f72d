#!/usr/bin/python3
"""LinuxCNC's set points to a twin, and its switches back, without a realtime component of ours: a sampler in the servo
thread keeps the set points of each period, and this program, in userspace, sends them on as rows. So nothing is missed.
LinuxCNC is held (its threads call nothing meanwhile, as after `halcmd stop`) while it is more than AHEAD rows ahead or
an answer takes long, so that a switch comes back a few milliseconds of its time late, however slow or busy the computer
is. Should it get LATE rows ahead all the same, that ends in an emergency stop: it would look for switches that were
struck long ago.

    rows_by_sampler.py port=7800 scale=320,320,320 period=1000000

The pins are those of isel_twin_rows.c. Without an answer power-ok falls and stays low, and `silent` is 1.
"""

import ctypes
import select
import socket
import sys
import time

import hal

SAMPLER = 0x48534130  # key of sampler 0's shared memory (sampler.h and streamer.h of LinuxCNC)
NAMES = ["limit_x1", "limit_y1", "limit_z1", "limit_x2", "limit_y2", "limit_z2", "power_ok", "estop_1", "estop_2"]
IDLE_S = 0.0005  # between two looks at an empty sampler
AHEAD, LATE = 5, 500  # rows; 5 ms and 0.5 s with the usual servo period
SOON_S = 0.005  # an answer that takes longer holds LinuxCNC, too
PATIENCE_S = 10.0  # wall time for an answer: the twin may have to load something once


def make_pins():
    component = hal.component("isel-twin")
    for n in range(3):
        component.newpin(f"pos-{n}", hal.HAL_FLOAT, hal.HAL_IN)  # connected as the realtime component's; not read
        for name in ("limit-1", "limit-2", "fault"):
            component.newpin(f"{name}-{n}", hal.HAL_BIT, hal.HAL_OUT)
    for name in ("enable", "request"):
        component.newpin(name, hal.HAL_BIT, hal.HAL_IN)
    for name in ("power-ok", "estop-ok"):
        component.newpin(name, hal.HAL_BIT, hal.HAL_OUT)
    for name in ("silent", "refused"):
        component.newpin(name, hal.HAL_U32, hal.HAL_OUT)
    return component


class Twin:
    """The line to it."""

    def __init__(self, port):
        self._line = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)
        self._line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def ask(self, lines, late=lambda: None):
        """The answers to lines that are sent at once. late: called if one does not come soon. Raises OSError."""
        self._line.sendall("".join(f"{line}\n" for line in lines).encode())
        data = b""
        while data.count(b"\n") < len(lines):
            if not select.select([self._line], [], [], SOON_S)[0]:
                late()
            piece = self._line.recv(65_536)
            if not piece:
                raise OSError("it has closed the line")
            data += piece
        return data.decode("latin-1").splitlines()

    def begin(self):
        """LinuxCNC begins at 0, wherever the machine stands. Which bit is which of NAMES; None: it has none."""
        (names,) = self.ask(["names"])
        if not names.startswith("names axes=3 "):
            raise OSError(names)
        (answer,) = self.ask(["set 0 0 0"])
        if not answer.startswith("ok "):
            raise OSError(answer)
        known = names.split()[2:]
        return {name: known.index(name) if name in known else None for name in NAMES}


def show(component, answer, bit):
    """Put what the twin has answered to a row on the pins."""
    word, *rest = answer.split()
    if word != "ok":
        component["refused"] += 1
        component["power-ok"] = False
        if component["refused"] == 1:
            print(f"rows_by_sampler: {answer}", file=sys.stderr)
        return
    levels, faults = int(rest[1], 16), int(rest[2], 16)
    level = {name: at is None or bool(levels >> at & 1) for name, at in bit.items()}
    for n, axis in enumerate("xyz"):
        component[f"limit-1-{n}"] = not level[f"limit_{axis}1"]  # a struck switch is low
        component[f"limit-2-{n}"] = not level[f"limit_{axis}2"]
        component[f"fault-{n}"] = bool(faults >> n & 1)
    component["power-ok"] = level["power_ok"]
    component["estop-ok"] = level["estop_1"] and level["estop_2"]


def row(sample, scale, period):
    *places, enable, request = sample
    counts = " ".join(str(round(place * by)) for place, by in zip(places, scale, strict=True))
    return f"row {period} {counts} stages={enable:d} brake={enable:d} power_request={request:d}"


class Gate:
    """Holds LinuxCNC: its threads go on, and call nothing (bridge/31)."""

    def __init__(self):
        self._hal = ctypes.CDLL("liblinuxcnchal.so.0")
        self.closed = False

    def close(self):
        self.closed = self.closed or self._hal.hal_stop_threads() == 0

    def open(self):
        """Only what was closed here: LinuxCNC begins and ends by itself."""
        self.closed = self.closed and self._hal.hal_start_threads() != 0


def carry(component, twin, bit, samples, as_row, gate):
    """Rows to the twin and its answers back, until LinuxCNC ends. Raises OSError."""
    while True:
        waiting = []
        while samples.readable:
            waiting.append(as_row(samples.read()))
        if len(waiting) > LATE:
            raise OSError(f"it is {len(waiting)} rows late: this computer is too slow or too busy; use the component")
        if len(waiting) > AHEAD:
            gate.close()
        if waiting:
            for answer in twin.ask(waiting, gate.close):
                show(component, answer, bit)
        else:
            gate.open()
            time.sleep(IDLE_S)


def main():
    given = dict(word.split("=", 1) for word in sys.argv[1:])
    scale, period = [int(text) for text in given["scale"].split(",")], int(given["period"])
    component = make_pins()
    where = f"rows_by_sampler: the twin at 127.0.0.1:{given['port']}"
    try:
        twin = Twin(int(given["port"]))
        bit = twin.begin()
    except OSError as error:
        sys.exit(f"{where}: {error}")
    samples, gate = hal.stream(component, SAMPLER, "fffbb"), Gate()
    component.ready()
    try:
        try:
            carry(component, twin, bit, samples, lambda sample: row(sample, scale, period), gate)
        except (OSError, ValueError, ArithmeticError) as error:  # a set point may be no number
            component["silent"] = 1
            component["power-ok"] = component["estop-ok"] = False
            print(f"{where}: {error}", file=sys.stderr)
            gate.open()  # for LinuxCNC to see it
        while True:  # the pins stay, low
            time.sleep(1.0)
    except KeyboardInterrupt:  # LinuxCNC ends
        pass


if __name__ == "__main__":
    main()
