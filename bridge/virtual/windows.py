"""Window libraries in virtual time: they may be imported, and what would start their main loop is refused.

Programs whose logic does not need the window run so; a class of theirs may be derived from and named in annotations.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

from isel_twin.bridge.virtual.refusals import SERVE, refuse
from isel_twin.bridge.virtual.turns import here

_QT = tuple(
    (f"{package}.{module}", (name,))
    for package in ("PyQt5", "PyQt6", "PySide2", "PySide6")
    for module, name in (("QtWidgets", "QApplication"), ("QtGui", "QGuiApplication"), ("QtCore", "QCoreApplication"))
)
# classes of which an object is needed for a main loop, by module
LOOPS: dict[str, tuple[str, ...]] = {"tkinter": ("Tk",), "wx": ("App",), **dict(_QT)}
REMEDY = f"run the program's logic without its window, or {SERVE}"


def refusing(real: type, module: str) -> type:
    """The class, of which a thread of a host cannot make an object."""

    class Refusing(real):
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            if here() is not None:
                refuse(f"{module}.{real.__name__}, whose main loop waits in real time,", REMEDY)
            super().__init__(*args, **kwargs)

    Refusing.__name__ = Refusing.__qualname__ = real.__name__
    Refusing.__module__ = module
    return Refusing


class _Loader:
    """Loads a module as usual, and then replaces its classes."""

    def __init__(self, real: Any) -> None:
        self._real = real

    def create_module(self, spec: ModuleSpec) -> Any:
        return self._real.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        self._real.exec_module(module)
        for name in LOOPS[module.__name__]:
            if isinstance(real := getattr(module, name, None), type):
                setattr(module, name, refusing(real, module.__name__))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._real, name)


class Finder:
    """Finds these modules while a host imports them."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        if name not in LOOPS or here() is None:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = _Loader(spec.loader)  # type: ignore[assignment]
        return spec


def loaded() -> Iterator[tuple[ModuleType, str, type]]:
    """Each class of these modules that was imported before the host began, and its replacement."""
    for module_name, names in LOOPS.items():
        module = sys.modules.get(module_name)
        for name in names if module is not None else ():
            if isinstance(real := getattr(module, name, None), type) and real.__name__ != "Refusing":
                assert module is not None
                yield module, name, refusing(real, module_name)
