#!/usr/bin/python3
"""LinuxCNC's set points to a twin, and its switches back, without a realtime component of ours: a sampler in the servo
thread keeps the set points of each period, and this program, in userspace, sends them on as rows. So nothing is missed,
but what comes back is some milliseconds late, and differently late each time. A twin that falls behind by more than
LATE rows ends in an emergency stop: LinuxCNC would look for switches that were struck long ago.

    rows_by_sampler.py port=7800 scale=320,320,320 period=1000000

The pins are those of isel_twin_rows.c. Without an answer power-ok falls and stays low, and `silent` is 1.
"""

import socket
import sys
import time

import hal

SAMPLER = 0x48534130  # key of sampler 0's shared memory (sampler.h and streamer.h of LinuxCNC)
NAMES = ["limit_x1", "limit_y1", "limit_z1", "limit_x2", "limit_y2", "limit_z2", "power_ok", "estop_1", "estop_2"]
IDLE_S = 0.0005  # between two looks at an empty sampler
LATE = 500  # rows; 0.5 s with the usual servo period
AT_ONCE = 50  # rows sent before their answers are read


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
        connection = socket.create_connection(("127.0.0.1", port), timeout=10.0)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._file = connection.makefile("rwb")

    def ask(self, lines):
        """The answers to several lines, which are sent at once."""
        self._file.write("".join(f"{line}\n" for line in lines).encode())
        self._file.flush()
        answers = [self._file.readline().decode() for _ in lines]
        if not answers[-1].endswith("\n"):
            raise OSError("the twin has closed the line")
        return answers


def show(component, answer, bit):
    """Put what the twin has answered to a row on the pins."""
    word, *rest = answer.split()
    if word != "ok":
        component["refused"] += 1
        component["power-ok"] = False
        if component["refused"] == 1:
            print(f"rows_by_sampler: {answer.strip()}", file=sys.stderr)
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


def main():
    given = dict(word.split("=", 1) for word in sys.argv[1:])
    scale, period = [int(text) for text in given["scale"].split(",")], int(given["period"])
    component = make_pins()
    try:
        twin = Twin(int(given["port"]))
        (names,) = twin.ask(["names"])
        known = names.split()[2:]
        bit = {name: known.index(name) if name in known else None for name in NAMES}
        twin.ask(["set 0 0 0"])  # LinuxCNC begins at 0, wherever the machine stands
        samples = hal.stream(component, SAMPLER, "fffbb")
        component.ready()
        while True:
            waiting = []
            while samples.readable:
                waiting.append(row(samples.read(), scale, period))
            if len(waiting) > LATE:
                raise OSError(
                    f"it is {len(waiting)} rows late: this computer is too slow or too busy; use the component"
                )
            for at in range(0, len(waiting), AT_ONCE):
                show(component, twin.ask(waiting[at : at + AT_ONCE])[-1], bit)
            if not waiting:
                time.sleep(IDLE_S)
    except KeyboardInterrupt:  # LinuxCNC ends
        pass
    except OSError as error:
        component["silent"] = 1
        component["power-ok"] = component["estop-ok"] = False
        print(f"rows_by_sampler: the twin at 127.0.0.1:{given['port']}: {error}", file=sys.stderr)
        try:
            while True:  # the pins stay, low
                time.sleep(1.0)
        except KeyboardInterrupt:
            pass


if __name__ == "__main__":
    main()
