"""A thread reads and hands lines over in a queue; the main thread sends and waits for them.

python reader.py PORT
"""

import logging
import queue
import sys
import threading
from time import monotonic

from serial import Serial, SerialException

LENGTHS = {"@0P": 19}
"""Bytes of a reply, if they are more than one."""

log = logging.getLogger("reader")


class Reader(threading.Thread):
    """Puts every byte that arrives into a queue."""

    def __init__(self, port):
        super().__init__(name="reader", daemon=True)
        self.port = port
        self.bytes = queue.Queue()
        self.stopped = threading.Event()

    def run(self):
        """Read until told to stop."""
        while not self.stopped.is_set():
            for byte in self.port.read(self.port.in_waiting or 1):
                self.bytes.put(byte)


def ask(port, reader, command):
    """Send a command, return its reply."""
    began = monotonic()
    port.write(command.encode() + b"\r")
    reply = bytes(reader.bytes.get(timeout=90) for _ in range(LENGTHS.get(command, 1)))
    log.info("%s -> %s in %.1f s", command, reply.decode(), monotonic() - began)
    print(command, reply.decode())


def main():
    """Reference run, one move, and the position."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    try:
        port = Serial(sys.argv[1], 19200, timeout=0.2)
    except SerialException as error:
        sys.exit(str(error))
    with port:
        reader = Reader(port)
        reader.start()
        for command in ("@07", "@0R7", "@0A1600,6000,800,6000,0,30,0,30", "@0P"):
            ask(port, reader, command)
        reader.stopped.set()
        reader.join(2)
        print("reader", "alive" if reader.is_alive() else "ended")


if __name__ == "__main__":
    main()
