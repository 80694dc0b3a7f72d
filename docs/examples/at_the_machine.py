"""The person at the machine, for a machine that is a served twin: plays a job, reads the gauge, fills in the form.

    isel-twin experiment day3 --axes x --seed 3
    isel-twin serve --machine hidden --tcp 127.0.0.1:4001 --control 127.0.0.1:4002 --speed 1 &
    isel-twin tap tcp://127.0.0.1:4001 --pty ./imc --record day3.mcap &
    python docs/examples/at_the_machine.py day3 --port ./imc --control 127.0.0.1:4002

The job goes through the tap, command by command, as a host sends it. Hands (pull, emergency stop) and eyes (gauge,
counter) are the control port of the served twin; the gauge is off by a few um, and its zero is anywhere. Stall speeds
stay nan: they take a series of their own (day3-stall.txt).
"""

from __future__ import annotations

import argparse
import json
import random
import re
import socket
import time
import tomllib
from pathlib import Path
from typing import Any

import serial


class Hands:
    """The control port of the served twin."""

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        self._file = socket.create_connection((host, int(port))).makefile("rw")

    def ask(self, **request: Any) -> dict[str, Any]:
        """One request, one answer."""
        print(json.dumps(request), file=self._file, flush=True)
        return json.loads(self._file.readline())["ok"]

    def pull(self, axis: str, before_n: float, force_n: float) -> float:
        """From one pull to another as slowly as by hand; returns the latter."""
        for part in range(1, 21) if force_n != before_n else ():
            self.ask(force_n={axis: before_n + (force_n - before_n) * part / 20}, place="tool")
            time.sleep(0.015)
        return force_n


def converse(port: serial.Serial, command: str, hands: Hands, acts: list[dict[str, Any]]) -> None:
    """Send a command, do what is to be done meanwhile, await the reply."""
    port.write(command.encode() + b"\r")
    sent = time.monotonic()
    for act in acts:
        time.sleep(max(0.0, sent + act["after_s"] - time.monotonic()))
        hands.ask(set=act["set"])
    port.read(1)
    time.sleep(0.05)
    port.read(port.in_waiting)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("name")
    parser.add_argument("--port", required=True)
    parser.add_argument("--control", required=True)
    parser.add_argument("--noise-mm", type=float, default=0.005)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    draw, hands = random.Random(options.seed), Hands(options.control)
    form = Path(f"{options.name}.toml")
    content = tomllib.loads(form.read_text())
    lines = (
        re.sub(r"(^|\s)#(?!\w).*|\s*=>.*", "", line) for line in Path(f"{options.name}.txt").read_text().splitlines()
    )
    zeros: dict[str, float] = {}
    pulled: dict[str, float] = {}  # by axis, N
    read: list[dict[str, float]] = []
    with serial.Serial(options.port, 19200, timeout=60) as port:
        for number, command in enumerate((line for line in lines if line), 1):
            converse(port, command, hands, [act for act in content["act"] if act["command"] == number])
            readings = [reading for reading in content["reading"] if reading["command"] == number]
            for reading in readings:
                axis = reading["axis"]
                pulled[axis] = hands.pull(axis, pulled.get(axis, 0.0), reading.get("push_n", 0.0))
                time.sleep(0.3)
                state, place = hands.ask(state=True), "xyz".index(axis)
                zero = zeros.setdefault(reading["gauge"], draw.uniform(0.0, 2.0))
                mm = state["position_mm"][place] - zero + draw.gauss(0.0, options.noise_mm)
                read.append({"mm": mm, "counter_mm": state["counts"][place] / 320.0})
            for axis, force_n in pulled.items():
                pulled[axis] = hands.pull(axis, force_n, 0.0)
            if readings:
                time.sleep(0.3)
    filled, numbers = [], iter(read)
    for line in form.read_text().splitlines():
        if line == "[[reading]]":
            values = next(numbers)
        key, _, value = line.partition(" = ")
        filled.append(f"{key} = {values[key]!r}" if value == "nan" and key in ("mm", "counter_mm") else line)
    form.write_text("\n".join(filled) + "\n")


if __name__ == "__main__":
    main()
