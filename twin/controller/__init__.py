"""The border between a firmware and everything around it.

controller.py   what a controller is, and its protocol of time
events.py       its outputs as data: replies, levels, counters, flash
roles.py        optional abilities: reading drives, keys, a handshake, programs
registry.py     which ones are installed, by entry points; settings they take
"""

from __future__ import annotations

from isel_twin.controller.controller import Controller, SerialFormat
from isel_twin.controller.events import (
    OUTPUTS,
    CounterSet,
    Event,
    FlashWrite,
    Output,
    ReferenceSearch,
    Remark,
    Reply,
    Step,
)
from isel_twin.controller.registry import (
    ControllerFactory,
    PluginError,
    Setting,
    UnknownNameError,
    controller_factory,
    controller_names,
    controller_settings,
    create_controller,
    plugin_errors,
    readings_in_force,
    takes,
)
from isel_twin.controller.roles import (
    BYTES_AT_ONCE,
    Arrival,
    AwaitsArrival,
    DriveInput,
    Drives,
    EndsPrograms,
    HasKeys,
    HoldsHost,
    KeepsBytes,
    Key,
    KeyValue,
    NamesOutputs,
    TellsFault,
    UsesDrives,
    offers,
)

__all__ = [
    "BYTES_AT_ONCE",
    "OUTPUTS",
    "Arrival",
    "AwaitsArrival",
    "Controller",
    "ControllerFactory",
    "CounterSet",
    "DriveInput",
    "Drives",
    "EndsPrograms",
    "Event",
    "FlashWrite",
    "HasKeys",
    "HoldsHost",
    "KeepsBytes",
    "Key",
    "KeyValue",
    "NamesOutputs",
    "Output",
    "PluginError",
    "ReferenceSearch",
    "Remark",
    "Reply",
    "SerialFormat",
    "Setting",
    "Step",
    "TellsFault",
    "UnknownNameError",
    "UsesDrives",
    "controller_factory",
    "controller_names",
    "controller_settings",
    "create_controller",
    "offers",
    "plugin_errors",
    "readings_in_force",
    "takes",
]
