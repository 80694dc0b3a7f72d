"""Polls the port until a reply is there: the way of most first host programs.

python polling.py PORT [MOVES]
"""

import sys
import time

import serial


def ask(port, command, timeout=120.0):
    """Send a command, return its reply."""
    port.write(command.encode() + b"\r")
    end = time.time() + timeout
    reply = b""
    while time.time() < end:
        if port.in_waiting:
            reply += port.read(port.in_waiting)
        elif reply:
            break
        time.sleep(0.05)
    print(command, reply.decode())
    return reply


def main():
    """Reference run, then to and fro."""
    port = serial.Serial(sys.argv[1], 19200, timeout=0)
    moves = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    if ask(port, "@07") != b"0":
        sys.exit("the controller does not answer")
    ask(port, "@0R7")
    for move in range(moves):
        x = 3200 if move % 2 == 0 else 0
        ask(port, f"@0M{x},8000,1600,8000,0,5000,0,30")
        time.sleep(0.1)
    ask(port, "@0P")
    port.close()


if __name__ == "__main__":
    main()
