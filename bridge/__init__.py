"""Where hosts connect: everything that knows a wall clock, a socket or a device.

serve/    a twin behind ports, in real time: `isel-twin serve`
operate/  what a person at the machine would do: functions, control port, panel
tap/      between a real host and a real controller: `isel-twin tap`
virtual/  in process and in virtual time: `isel-twin exec`, pySerial's twin://
pytest/   twins as fixtures of pytest
demo.py   `make demo`
"""

if __name__ != "isel_twin.bridge":
    raise ImportError(f"import isel_twin.bridge, not {__name__}: the folder bridge/ of the repository is that package")
