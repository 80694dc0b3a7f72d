"""A twin as an FMU: FMI 3.0 co-simulation, for simulation tools.

    slaves.py    the two models: serial (bytes of a host), steps (set points of another control)
    builder.py   the file

The file has these models by name only: the importer's process needs a Python with isel-twin (docs/connections.md).
"""
