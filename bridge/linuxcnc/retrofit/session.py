#!/usr/bin/python3
"""A session without a screen: home, then the lines of ISEL_TWIN_MDI, one after the other. LinuxCNC calls it as its
display program and ends with its exit code: 0, 1 an error of LinuxCNC, 2 too late, 3 an emergency stop."""

import os
import sys
import time

import linuxcnc

END = time.monotonic() + float(os.environ.get("ISEL_TWIN_PATIENCE_S", "120"))
stat, command, errors = linuxcnc.stat(), linuxcnc.command(), linuxcnc.error_channel()


def finish(code, text):
    print(f"session: {text}", flush=True)
    sys.exit(code)


def until(true, what, running=True):
    """Wait for it; an error that LinuxCNC tells ends the session."""
    while True:
        stat.poll()
        over = true()
        if running and stat.task_state == linuxcnc.STATE_ESTOP:
            finish(3, f"{what}: emergency stop")
        while told := errors.poll():
            if told[0] in (linuxcnc.NML_ERROR, linuxcnc.OPERATOR_ERROR):  # others are messages of a program
                finish(1, f"{what}: {told[1]}")
        if over:
            return
        if time.monotonic() > END:
            finish(2, f"{what}: not in time")
        time.sleep(0.005)


def done(what):
    """Wait for the end of what was commanded; a busy task may not have begun yet."""
    until(lambda: command.wait_complete(0.05) != -1, what)
    idle = linuxcnc.EXEC_DONE, linuxcnc.INTERP_IDLE, True
    until(lambda: (stat.exec_state, stat.interp_state, bool(stat.inpos)) == idle, what)


def main():
    while True:  # the task may not be there yet
        try:
            stat.poll()
            break
        except linuxcnc.error:
            if time.monotonic() > END:
                finish(2, "LinuxCNC does not start")
            time.sleep(0.05)
    command.state(linuxcnc.STATE_ESTOP_RESET)
    until(lambda: stat.task_state != linuxcnc.STATE_ESTOP, "the emergency stop is not reset", running=False)
    command.state(linuxcnc.STATE_ON)
    until(lambda: stat.task_state == linuxcnc.STATE_ON, "the machine does not come on")
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete()
    command.home(-1)
    until(lambda: all(stat.homed[:3]) and stat.inpos, "homing")
    print("session: homed", flush=True)
    command.mode(linuxcnc.MODE_MDI)
    command.wait_complete()
    for line in filter(None, os.environ.get("ISEL_TWIN_MDI", "").splitlines()):
        command.mdi(line)
        done(line)
        print(f"session: {line}: {' '.join(f'{mm:.4f}' for mm in stat.joint_actual_position[:3])}", flush=True)
    finish(0, "done")


main()
