"""Real time: for a minute a stored program sends a character ten times a second; each comes never early, hardly late.

    host      @0S
    line      4 bytes           1 byte              1 byte
    twin              '!'--------------'!'--------------'!' ...     100 ms apart, exactly

Measured at the host, against the moment before it sent the command.
"""

from __future__ import annotations

import os
import time
import tty

from tests.reliability.figures import Figure, ask, main, serving

NUMBER = 60
EVERY_S = 0.1
BYTE_S = 10 / 19_200
LATE_MS = 10.0


def lateness_ms(plant: str, seconds: int) -> list[float]:
    """How late each character comes, in ms; negative: early."""
    characters = round(seconds / EVERY_S)
    with serving("--pty", speed="1", plant=plant) as served:
        with served.open("pty") as port:
            for command in ("@07", "@0N7", "@0i", "133", "51", f"3{characters - 1},-2", "9"):
                if ask(port, command) != "0":
                    raise RuntimeError(f"{command} was refused")
        device = os.open(served.info["pty"], os.O_RDWR | os.O_NOCTTY)
        try:
            tty.setraw(device)  # pySerial leaves it so that a read does not wait
            time.sleep(0.5)
            late = []
            began = time.perf_counter()
            os.write(device, b"@0S\r")
            for number in range(characters):
                if os.read(device, 1) != b"!":
                    raise RuntimeError("the program sent something else")
                due = 5 * BYTE_S + number * EVERY_S
                late.append((time.perf_counter() - began - due) * 1e3)
        finally:
            os.close(device)
    return late


def measure(number: int) -> list[Figure]:
    figures = []
    for plant in ("kinematic", "mujoco"):
        late = lateness_ms(plant, number)
        figures += [
            Figure(
                f"{plant}: earliest of {len(late)} characters within {number} s at speed 1", -min(late), "ms early", 0
            ),
            Figure(f"{plant}: latest of them", max(late), "ms late", LATE_MS),
            Figure(f"{plant}: latest in the last tenth", max(late[-len(late) // 10 :]), "ms late", LATE_MS),
        ]
    return figures


if __name__ == "__main__":
    main(measure, NUMBER)
