"""Where hosts connect: all code with a wall clock, a socket or a device.

serve/    a twin behind ports, in real time: `isel-twin serve`
operate/  operating the machine: functions, control port, panel
tap/      between a real host and a real controller: `isel-twin tap`
virtual/  in process and in virtual time: `isel-twin exec`, pySerial's twin://
pytest/   twins as fixtures of pytest
demo.py   `make demo`
"""

if __name__ != "isel_twin.bridge":
    raise ImportError(f"import isel_twin.bridge, not {__name__}: the folder bridge/ of the repository is that package")
