"""`isel-twin doctor`: what of an installation works, what does not, and the remedy."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass

from isel_twin.base.units import SECOND_NS
from isel_twin.cli.options import Json

LONGEST_NS = 120 * SECOND_NS  # virtual time for a reference run
WIDE = 15  # columns of what was looked at
NEWEST = (3, 14)  # Python that the tests know
PURPOSES = {
    "panel": "the operator panel in a browser",
    "report": "pictures of jobs and motors",
    "trace": "Parquet files",
    "tune": "tune, sweep, identify",
    "cluster": "sweeps on a cluster",
    "learn": "CMA-ES and PPO",
    "lsp": "findings in an editor",
}


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    what: str
    state: str  # ok; missing: only what is optional; wrong
    found: str
    remedy: str = ""


def doctor(*, json: Json = False) -> int:
    """Look at Python, libraries, extras, compiled core, plug-ins, serial ports and sockets: what works, and the remedy.

    Exit code 0 if nothing is wrong; what is optional may be missing.
    """
    found: list[Finding] = []
    for one in _findings():
        found.append(one)
        if not json:
            remedy = f"; {one.remedy}" if one.remedy else ""
            print(f"{one.state:8} {one.what:{WIDE}}  {one.found}{remedy}", flush=True)
    well = all(one.state != "wrong" for one in found)
    if json:
        from isel_twin.cli.outputs import say_json

        say_json({"ok": well, "findings": [asdict(one) for one in found]})
    return 0 if well else 1


def _findings() -> Iterator[Finding]:
    for examine in (_python, _libraries, _extras, _plugins, _terminal, _socket, _listed, _core, _job):
        try:
            yield from examine()
        except Exception as error:  # whatever is wrong with an installation is what is asked for
            name = examine.__name__.strip("_")
            why = " ".join(str(error).split()) or type(error).__name__
            yield Finding(name, "wrong", why, "reinstall isel-twin")


def _python() -> Iterator[Finding]:
    version = ".".join(map(str, sys.version_info[:3]))
    if sys.version_info[:2] > NEWEST:
        yield Finding("Python", "missing", f"{version}: not tested", "use Python 3.11 to 3.14")
    else:
        yield Finding("Python", "ok", f"{version}, {sys.executable}")


def _libraries() -> Iterator[Finding]:
    from importlib import import_module
    from importlib.metadata import version

    for name, module in (
        ("mujoco", "mujoco"),
        ("numpy", "numpy"),
        ("pyserial", "serial"),
        ("mcap", "mcap"),
    ):
        import_module(module)
        yield Finding(name, "ok", version(name))


def _extras() -> Iterator[Finding]:
    from importlib.metadata import PackageNotFoundError, requires, version

    needed: dict[str, list[str]] = {extra: [] for extra in PURPOSES}
    for requirement in requires("isel-twin") or ():
        package, _, marker = requirement.partition(";")
        for extra, packages in needed.items():
            if f'extra == "{extra}"' in marker.replace("'", '"'):
                packages.append(package.strip().split(">")[0].split("<")[0].split("=")[0].strip())
    for extra, packages in needed.items():
        missing = []
        for package in packages:
            try:
                version(package)
            except PackageNotFoundError:
                missing.append(package)
        if missing:
            remedy = f"pip install 'isel-twin[{extra}]'"
            yield Finding(f"[{extra}]", "missing", f"{PURPOSES[extra]}: without {', '.join(missing)}", remedy)
        else:
            yield Finding(f"[{extra}]", "ok", PURPOSES[extra])


def _core() -> Iterator[Finding]:
    from isel_twin.native import CoreError, core

    try:
        core.load()
    except CoreError as error:
        yield Finding("compiled core", "wrong", str(error))  # which tells the remedy, too
    else:
        way = "abreast (AVX2)" if core.abreast else "one after the other"
        yield Finding("compiled core", "ok", f"{core.path}, axes {way}")


def _plugins() -> Iterator[Finding]:
    from isel_twin.controller import PluginError, controller_factory, controller_names
    from isel_twin.language import create_language
    from isel_twin.models import machine_names

    working = []
    for name in controller_names():
        try:
            controller_factory(name)
            create_language(name)
            working.append(name)
        except PluginError as error:
            yield Finding(name, "wrong", str(error), "update or uninstall its package")
    yield Finding("controllers", "ok", ", ".join(working))
    yield Finding("machines", "ok", ", ".join(machine_names()))


def _terminal() -> Iterator[Finding]:
    """A pseudo terminal, which hosts open as a serial port."""
    try:
        from isel_twin.bridge.serve.pty import PtyEndpoint

        end = PtyEndpoint()
    except (ImportError, OSError) as error:
        why = getattr(error, "strerror", None) or str(error)
        yield Finding("serve --pty", "missing", f"no pseudo terminal: {why}", "serve --tcp or --rfc2217 do without")
        return
    yield Finding("serve --pty", "ok", f"for example {end.address}")
    end.close()


def _socket() -> Iterator[Finding]:
    import socket

    with socket.create_server(("127.0.0.1", 0)) as server:
        yield Finding("serve --tcp", "ok", f"for example 127.0.0.1:{server.getsockname()[1]}")


def _listed() -> Iterator[Finding]:
    from isel_twin.bridge.serve.registry import folder, served

    yield Finding("served now", "ok", f"{len(list(served()))}, listed in {folder()}")


def _job() -> Iterator[Finding]:
    """The whole chain once, with physics: reference run and a move of X."""
    from isel_twin import Twin
    from isel_twin.core.spec import TwinSpec
    from isel_twin.language import MoveSettings, create_language, needed

    twin = Twin()
    language = needed(create_language(TwinSpec.controller), TwinSpec.controller)
    steps = (1600, 0, 0)
    for data in (*language.reference(), *language.move(steps, MoveSettings(speed_hz=1000))):
        twin.write(data)
        while not twin.idle and twin.time_ns < LONGEST_NS:
            twin.run(0.1)
    moved_mm, wanted_mm = float(twin.position_mm[0]), steps[0] / twin.machine.axes[0].steps_per_mm
    state = "ok" if abs(moved_mm - wanted_mm) < 0.1 else "wrong"
    yield Finding("the whole chain", state, f"a move to X {wanted_mm:g} mm ends at {moved_mm:.3f} mm")
