"""The shape of a program with windows: a main loop of timed events, and a watch on a timer of its own.

    python timer.py PORT

`after` is that of tkinter; the loop is the one of `sched`, since a window needs a screen.
"""

import sched
import sys
import threading
import time

import serial

COMMANDS = ["@07", "@0R7", "@0M800,4000,800,4000,0,5000,0,30", "@0A-400,4000,0,30,0,30,0,30"]
TICK_S = 0.1


class Window:
    """Sends a command when the one before is answered; looks at the port every tick."""

    def __init__(self, name):
        self.port = serial.serial_for_url(name, baudrate=19200, timeout=0)
        self.loop = sched.scheduler(time.monotonic, time.sleep)
        self.left = list(COMMANDS)
        self.waits = False
        self.silent = 0
        self.lock = threading.Lock()
        self.watch = None

    def after(self, seconds, call):
        """Call a function later, in the main loop."""
        self.loop.enter(seconds, 1, call)

    def tick(self):
        """One look at the port."""
        with self.lock:
            reply = self.port.read(64)
            if reply:
                print("<", reply.decode())
                self.waits, self.silent = False, 0
            if not self.waits:
                if not self.left:
                    self.watch.cancel()
                    return
                command = self.left.pop(0)
                print(">", command)
                self.port.write(command.encode() + b"\r")
                self.waits = True
        self.after(TICK_S, self.tick)

    def watch_out(self):
        """Every second, in a thread of a timer: has the controller been silent for too long?"""
        with self.lock:
            self.silent += 1
            if self.silent > 60:
                print("silent")
        self.begin_watch()

    def begin_watch(self):
        """Set the timer anew."""
        self.watch = threading.Timer(1.0, self.watch_out)
        self.watch.daemon = True
        self.watch.start()

    def main(self):
        """Run until there is nothing more to do."""
        self.begin_watch()
        self.after(TICK_S, self.tick)
        self.loop.run()
        self.port.close()
        print("closed")


if __name__ == "__main__":
    Window(sys.argv[1]).main()
