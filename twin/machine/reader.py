"""Machine files: `models/<name>/machine.toml` to a `Machine`.

Four rules make files short:

    based_on = "4030"     start from another machine, by name or by path relative to this folder, and say what differs;
                          with a `model` of its own a machine also brings all of its own [masses] and [structure]
    [axes.all]            holds for X, Y and Z; [axes.x] and so on override it
    [switches]            holds for all position switches; an entry in [contacts] may override it

    current_rms           of a stage, where its drive says its current as RMS: the peak, `current`, is 1.414 times it

Settings under [controller] are those of `isel_twin.controller.takes`.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import Limits, Place, merge, parse_toml, quantity, read_text, spread, table
from isel_twin.machine.build import DEFAULT_DRIVE, DRIVES, build
from isel_twin.machine.mjcf import check_meshes, check_near, file_content, model_files
from isel_twin.machine.schema import DEFAULT_CABINET, Machine, MachineError
from isel_twin.models import machine_names, models_folder

_RMS = "current_rms"
_CURRENT_RMS_A = Limits("A", 0.1, 20.0 / math.sqrt(2.0))


class _Loaded(NamedTuple):
    machine: Machine
    contents: Mapping[Path, bytes | None]  # of every file it was read from; None: a file that does not exist


_MOST_LOADED = 32
_MOST_BASES = 16
_loaded: dict[Path, _Loaded] = {}  # cache by file: read again only when a file has changed


def load_machine(name_or_path: str | Path) -> Machine:
    """Read a machine by its name, or by the path of a folder with a machine.toml (or of that file).

    Returns the same object while the contents of its files are the same. Raises MachineError with one line that names
    the file, the key and what is allowed.
    """
    file = _find(name_or_path)
    loaded = _loaded.get(file)
    if loaded is not None and all(file_content(path) == content for path, content in loaded.contents.items()):
        return loaded.machine
    files: list[Path] = []
    tree = _read_file(file, files)
    tree.setdefault("cabinet", DEFAULT_CABINET)
    machine = build(tree, file)
    files += [*model_files(machine.model_file), *(model_files(machine.fixture_file) if machine.fixture_file else [])]
    files += [fixture.file for fixture in machine.fixtures if fixture.file is not None]
    if len(_loaded) >= _MOST_LOADED:
        _loaded.clear()
    _loaded[file] = _Loaded(machine, {path: file_content(path) for path in files})
    return machine


def machine_from_tree(tree: Mapping[str, Any], file: Path) -> Machine:
    """The machine of a saved tree (`Machine.tree`); file: where its machine.toml would be. Raises MachineError."""
    return build(copy.deepcopy(dict(tree)), file)


def _find(name_or_path: str | Path, relative_to: Path | None = None) -> Path:
    candidates = [models_folder() / name_or_path] if str(name_or_path) in machine_names() else []
    path = Path(name_or_path).expanduser()
    candidates.append(relative_to / path if relative_to else path)
    for candidate in candidates:
        file = candidate if candidate.is_file() else candidate / "machine.toml"
        if file.is_file():
            return file.resolve()
    raise MachineError(
        f"unknown machine {str(name_or_path)!r}: not a folder with a machine.toml and not one of "
        f"{', '.join(machine_names())}"
    )


def _read_file(file: Path, seen: list[Path]) -> dict[str, Any]:
    """The tree with `based_on` and [axes.all] resolved; seen: files read so far, extended here."""
    place = Place(file, MachineError)
    if file in seen:
        raise place.at("based_on").wrong("goes round in a circle; allowed: a machine that does not need this one")
    if len(seen) >= _MOST_BASES:
        raise place.at("based_on").wrong(f"goes on and on; allowed: {_MOST_BASES} machines, one based on the other")
    seen.append(file)
    try:
        tree = parse_toml(read_text(place), place)
    except OSError as error:
        raise place.wrong(f"cannot be read: {error}") from None
    _check_paths(tree, place, file.parent)
    _as_peak(tree, place)
    spread(tree, "axes", CARRIAGES, place)
    if "based_on" in tree:
        parent_file = _find(str(tree.pop("based_on")), file.parent)
        parent = _read_file(parent_file, seen)
        if "model" in tree:
            parent = {**parent, "masses": {}, "structure": {}}
        for key in ("model", "fixture"):
            if key not in tree and isinstance(parent.get(key), list):
                tree[key] = [_from_here(entry, parent_file.parent) for entry in parent[key]]
            elif key not in tree and parent.get(key):
                tree[key] = str(parent_file.parent / str(parent[key]))
        tree = merge(_without_other_drives(parent, tree, place), tree)
    return tree


def _check_paths(tree: Mapping[str, Any], place: Place, folder: Path) -> None:
    """Refuse files that lie neither below the folder of a machine nor beside it."""
    for key in ("based_on", "model", "fixture"):
        name = tree.get(key)
        if isinstance(name, str) and not (key == "based_on" and name in machine_names()):
            check_near(name, folder, place.at(key))
    check_meshes(tree.get("fixture"), place.at("fixture"), folder)


def _as_peak(tree: Mapping[str, Any], place: Place) -> None:
    """Currents of stages that are given as RMS, as some drives print them, become the peak."""
    axes = table(tree.get("axes", {}), place.at("axes"))
    for name, axis in axes.items():
        stage = axis.get("stage") if isinstance(axis, dict) else None
        if isinstance(stage, dict) and _RMS in stage:
            where = place.at("axes").at(name).at("stage").at(_RMS)
            if "current" in stage:
                raise where.wrong("given beside current; give the peak (current) or the RMS value, not both")
            rms = stage.pop(_RMS)
            peak_a = math.sqrt(2.0) * quantity(rms, _CURRENT_RMS_A, where)
            stage["current"] = {**rms, "value": round(peak_a, 4), "source": f"{rms['value']:g} A RMS; {rms['source']}"}
            if "interval" in rms:
                stage["current"]["interval"] = [round(math.sqrt(2.0) * end, 4) for end in rms["interval"]]


def _from_here(entry: Any, folder: Path) -> Any:
    """A [[fixture]] table of a file in another folder, its mesh found from anywhere."""
    if not isinstance(entry, dict) or not isinstance(entry.get("file"), str):
        return entry
    return {**entry, "file": str(folder / entry["file"])}


def _without_other_drives(parent: Mapping[str, Any], tree: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """The parent without the keys of its drives where the tree has another kind."""
    result = copy.deepcopy(dict(parent))
    for name, axis in table(tree.get("axes", {}), place.at("axes")).items():
        before = result["axes"][name]
        was = before.get("drive", DEFAULT_DRIVE)
        if axis.get("drive", was) != was:
            result["axes"][name] = {key: value for key, value in before.items() if key not in DRIVES.get(was, ())}
    return result
