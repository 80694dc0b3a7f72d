"""The data items of the machine: their description for an agent (Devices.xml), and their values.

Vocabulary: MTConnect standard, part 2 (devices) and part 3 (observations). Positions are in the zero of the counters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.printable import shown_line
from isel_twin.bridge.operate.conditions import State, conditions, emergency, powered, program

SCHEMA = "urn:mtconnect.org:MTConnectDevices:2.0"
EXECUTION = {"Running": "ACTIVE", "Ended": "READY", "Interrupted": "INTERRUPTED", "Aborted": "STOPPED"}


@dataclass(frozen=True)
class Item:
    """A data item. value: of a sample or event, as text; of a condition "" if normal, else what is wrong."""

    key: str
    component: str  # where it belongs: device, an axis, controller, path, door, electric
    category: str  # SAMPLE, EVENT, CONDITION
    type: str
    value: Callable[[State], str]
    sub_type: str = ""
    units: str = ""


def _axis_items(at: int, axis: str) -> Iterator[Item]:
    letter = axis.upper()

    def position(state: State) -> str:
        return f"{state['position_mm'][at]:.4f}"

    def commanded(state: State) -> str:
        return f"{state['position_mm'][at] - state['position_error_mm'][at]:.4f}"

    where, mm = f"axis {letter}", "MILLIMETER"
    yield Item(f"{letter}act", where, "SAMPLE", "POSITION", position, "ACTUAL", mm)
    yield Item(f"{letter}com", where, "SAMPLE", "POSITION", commanded, "COMMANDED", mm)
    yield Item(f"{letter}pos", where, "CONDITION", "POSITION", _condition(f"lost_{axis}"))
    yield Item(f"{letter}drive", where, "CONDITION", "SYSTEM", _condition(f"drive_{axis}"))


def _condition(name: str) -> Callable[[State], str]:
    return lambda state: conditions(state)[name]


ITEMS: tuple[Item, ...] = (
    Item("avail", "device", "EVENT", "AVAILABILITY", lambda s: "AVAILABLE"),
    *(item for at, axis in enumerate(CARRIAGES) for item in _axis_items(at, axis)),
    Item("estop", "controller", "EVENT", "EMERGENCY_STOP", lambda s: "TRIGGERED" if emergency(s) else "ARMED"),
    Item("sys", "controller", "CONDITION", "SYSTEM", _condition("power")),
    Item("logic", "controller", "CONDITION", "LOGIC_PROGRAM", _condition("controller")),
    Item("comms", "controller", "CONDITION", "COMMUNICATIONS", _condition("line")),
    Item("exec", "path", "EVENT", "EXECUTION", lambda s: EXECUTION[program(s)]),
    Item(
        "mode",
        "path",
        "EVENT",
        "CONTROLLER_MODE",
        lambda s: "MANUAL" if s["inputs"].get("key") == "setup" else "SEMI_AUTOMATIC",
    ),
    Item(
        "hood",
        "door",
        "EVENT",
        "DOOR_STATE",
        lambda s: "CLOSED" if s["inputs"].get("hood", "closed") == "closed" else "OPEN",
    ),
    Item("power", "electric", "EVENT", "POWER_STATE", lambda s: "ON" if powered(s) else "OFF"),
)


def values(state: State) -> dict[str, str]:
    """The value of each item by its key, from an answer to {"state": true}."""
    return {item.key: item.value(state) for item in ITEMS}


def devices(state: State) -> bytes:
    """Devices.xml for the agent. It fills the header in."""
    root = ElementTree.Element("MTConnectDevices", xmlns=SCHEMA)
    name = shown_line(str(state["machine"]))
    device = ElementTree.SubElement(
        ElementTree.SubElement(root, "Devices"), "Device", id="d", uuid=f"isel-{name}-twin", name=name.replace(" ", "_")
    )
    about = {"manufacturer": "isel (simulated)", "model": name}
    ElementTree.SubElement(device, "Description", about).text = f"controlled by {shown_line(str(state['controller']))}"
    _items(device, "device")
    inner = ElementTree.SubElement(device, "Components")
    axes = _component(inner, "Axes", "axes", name="base")
    for axis in CARRIAGES:
        linear = _component(axes, "Linear", axis, name=axis.upper())
        _items(linear, f"axis {axis.upper()}")
    controller = ElementTree.SubElement(inner, "Controller", id="c", name="controller")
    _items(controller, "controller")
    path = _component(ElementTree.SubElement(controller, "Components"), "Path", "p", name="path")
    _items(path, "path")
    door = _component(inner, "Door", "hood_door", name="hood")  # the schemas know no group of doors
    _items(door, "door")
    electric = _component(_component(inner, "Systems", "systems"), "Electric", "electric", name="supply")
    _items(electric, "electric")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


def _component(above: ElementTree.Element, kind: str, ident: str, name: str = "") -> Any:
    """A component; a group of components gives what they are put into."""
    made = ElementTree.SubElement(above, kind, {"id": ident, **({"name": name} if name else {})})
    groups = ("Axes", "Systems")
    return ElementTree.SubElement(made, "Components") if kind in groups else made


def _items(component: ElementTree.Element, where: str) -> None:
    listed = ElementTree.SubElement(component, "DataItems")
    for item in ITEMS:
        if item.component == where:
            about = {"id": item.key, "name": item.key, "category": item.category, "type": item.type}
            about |= {"subType": item.sub_type} if item.sub_type else {}
            about |= {"units": item.units, "nativeUnits": item.units} if item.units else {}
            ElementTree.SubElement(listed, "DataItem", about)
