"""A pytest plugin: twins as fixtures, and recordings of failing tests.

    marker, ini keys --- call_of ---> twin, twin_serial, twin_server, virtual_host, watched,
                                        |               linuxcnc
                                        |
    a test fails ---> the twin is built again and repeats its run, now recorded (bridge/pytest/kept.py)
                      ---> recording, picture and command to repeat it, in the report of the test

With --isel-port `watched` is a real controller's, and the other fixtures skip their tests (real.py).

pytest imports this at every start, in any project, so other imports are local. A wrong key or value gives one line: in
the marker at each test that has it, in an ini key before any test (bridge/21).
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, cast

import pytest

from isel_twin.bridge.pytest.without import NoTwin, no_twin

if TYPE_CHECKING:
    from pathlib import Path

    from isel_twin.bridge.pytest.kept import KeptTwins, ServedTwin
    from isel_twin.bridge.pytest.linuxcnc import LinuxCnc
    from isel_twin.bridge.pytest.real import RealWatched
    from isel_twin.bridge.virtual.protocol_twin import Serial
    from isel_twin.bridge.virtual.virtual_host import HostRun
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.checks.watched import Watched

__all__ = ["linuxcnc", "twin", "twin_call", "twin_factory", "twin_serial", "twin_server", "virtual_host", "watched"]

INI: Mapping[str, str] = {  # keys of the ini file, with isel_twin_ before them
    "machine": "name of a machine, or a machine folder seen from the ini file",
    "controller": "name of a controller",
    "plant": "mujoco or kinematic",
    "scenario": "scenario file, seen from the ini file",
    "seed": "whole number",
    "artifacts": "folder for what failing tests leave, seen from the ini file; without it the temporary folder of each",
}
LISTED = ("machine", "controller", "plant", "scenario", "seed")  # keys for which a list makes a test of each entry
KEYS = (*LISTED, "overrides", "start_mm")  # of the marker
OF_SERVERS = ("endpoint", "speed")  # keys for `twin_server` alone

MARKER = (
    f"twin({', '.join(f'{key}=...' for key in (*KEYS, *OF_SERVERS))}): how the twin of this test is built; "
    "a list of machines, controllers, plants, scenarios or seeds makes a test of each"
)

_kept = pytest.StashKey["KeptTwins"]()
_overlooked = pytest.StashKey[dict[str, list[str]]]()  # by test, what nobody could look at at a real controller


# The project's defaults


def pytest_addoption(parser: pytest.Parser) -> None:
    help_text = "send the jobs of `watched` to the real controller at this port: /dev/ttyUSB0, COM3, tcp://HOST:PORT"
    parser.getgroup("isel-twin").addoption("--isel-port", metavar="PORT", default=None, help=help_text)
    for key, meaning in INI.items():
        parser.addini(f"isel_twin_{key}", f"isel-twin: {meaning}", default="")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", MARKER)
    if "--isel-port" in config.invocation_params.args:  # pytest has already looked for its ini file at that "folder"
        raise pytest.UsageError("--isel-port: write --isel-port=PORT; behind a blank pytest takes it for a test folder")
    if _port(config) and getattr(config.option, "numprocesses", None):
        raise pytest.UsageError("--isel-port: there is one machine; leave -n (--numprocesses) out")
    if (seed := config.getini("isel_twin_seed")) and not (seed.isascii() and seed.isdigit()):
        raise pytest.UsageError(f"isel_twin_seed = {seed}: must be a whole number from 0")
    if (plant := config.getini("isel_twin_plant")) and plant not in ("mujoco", "kinematic"):
        raise pytest.UsageError(f"isel_twin_plant = {plant}: must be mujoco or kinematic")


def _defaults(config: pytest.Config) -> dict[str, Any]:
    call: dict[str, Any] = {key: value for key in LISTED if (value := config.getini(f"isel_twin_{key}"))}
    if "seed" in call:
        call["seed"] = int(call["seed"])
    return {key: _seen_from(_folder(config), key, value) for key, value in call.items()}


def _port(config: pytest.Config) -> str | None:
    """The port of a real controller."""
    port: str | None = config.getoption("--isel-port", None)
    return port


def _folder(config: pytest.Config) -> Path:
    return config.rootpath if config.inipath is None else config.inipath.parent


# The marker


def _marked(node: Any) -> dict[str, Any]:
    """The merged twin markers of a node; the nearest wins. A wrong key or value fails the test."""
    call: dict[str, Any] = {}
    for mark in reversed(list(node.iter_markers("twin"))):
        if mark.args:
            _wrong(f"pytest.mark.twin({mark.args[0]!r}): takes keys only, such as machine={mark.args[0]!r}")
        for key, value in mark.kwargs.items():
            if key == "overrides" and isinstance(value, Mapping):
                value = {**call.get("overrides", {}), **value}
            call[key] = value
    folder = node.path.parent
    return {key: _seen_from(folder, key, value) for key, value in _checked(call, "pytest.mark.twin").items()}


def _seen_from(folder: Path, key: str, value: Any) -> Any:
    """The value; a name that exists in the folder becomes its path."""
    if key == "scenario" and isinstance(value, str | os.PathLike) and (folder / value).is_file():
        return folder / value
    if key == "machine" and isinstance(value, str | os.PathLike) and (folder / value / "machine.toml").is_file():
        return str(folder / value)
    return value


def _checked(call: Mapping[str, Any], where: str) -> dict[str, Any]:
    for key, value in call.items():
        if key not in (*KEYS, *OF_SERVERS):
            _wrong(f"{where}: unknown key {key!r}; there are: {', '.join((*KEYS, *OF_SERVERS))}")
        for one in value if key in LISTED and isinstance(value, list | tuple) else (value,):
            if key == "seed" and (not isinstance(one, int) or isinstance(one, bool) or one < 0):
                _wrong(f"{where}: seed={one!r}; must be a whole number from 0")
            if key == "overrides" and not isinstance(one, Mapping):
                _wrong(f"{where}: overrides={one!r}; must be a table, such as {{'payload.mass': 5.0}}")
        if key in LISTED and isinstance(value, list | tuple) and not value:
            _wrong(f"{where}: {key}={value!r} is empty; name one or more")
    return dict(call)


def _wrong(line: str) -> None:
    pytest.fail(line, pytrace=False)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A list in the marker makes a test of each entry, two lists a test of each pair; at a real controller the first
    alone."""
    if "twin_call" not in metafunc.fixturenames:
        return
    lists: dict[str, list[Any]] = {}
    for mark in reversed(list(metafunc.definition.iter_markers("twin"))):
        for key, value in mark.kwargs.items():
            lists.pop(key, None)
            if key in LISTED and isinstance(value, list | tuple) and value:
                lists[key] = list(value)
    if not lists:
        return
    choices = [dict(zip(lists, values, strict=True)) for values in itertools.product(*lists.values())]
    choices = choices[:1] if _port(metafunc.config) else choices
    ids = ["-".join(_id(key, value) for key, value in choice.items()) for choice in choices]
    metafunc.parametrize("twin_call", choices, indirect=True, ids=ids)


def _id(key: str, value: Any) -> str:
    return f"seed{value}" if key == "seed" else str(getattr(value, "name", value)).rpartition("/")[2]


# At a real controller


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """What nobody could look at, test by test."""
    if overlooked := config.stash.get(_overlooked, None):
        terminalreporter.section(f"isel-twin at {_port(config)}: not looked at")
        for test, what in overlooked.items():
            terminalreporter.line(f"{test}: {', '.join(what)}")


# Fixtures


@pytest.fixture
def twin_call(request: pytest.FixtureRequest) -> dict[str, Any]:
    """The call of this test's twin: ini keys, overridden by the marker, overridden by a parameter (a table).

    `@pytest.mark.parametrize("twin_call", [{"seed": 1}, {"machine": "traverse"}], indirect=True)`
    """
    return _call(request, _parameter(request), "twin_call")


def _parameter(request: pytest.FixtureRequest) -> Mapping[str, Any]:
    """The parameter that a test gives to a fixture, or an empty table."""
    given: Any = getattr(request, "param", {})
    if not isinstance(given, Mapping):
        _wrong(f"{request.fixturename}: the parameter {given!r} is no table; give one such as {{'seed': 1}}")
    return given


def _call(request: pytest.FixtureRequest, given: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Ini keys, overridden by markers, overridden by `given`."""
    given = {key: _seen_from(request.path.parent, key, value) for key, value in _checked(given, where).items()}
    call = _defaults(request.config) | _marked(request.node) | given
    for key in LISTED:
        if isinstance(call.get(key), list | tuple):
            _wrong(f"{where}: {key}={call[key]!r}: a list makes tests, and here is one twin; give one of them")
    return call


@pytest.fixture(scope="session")
def _twins(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> KeptTwins:
    from isel_twin.bridge.pytest.kept import KeptTwins

    config = request.config
    folder = config.getini("isel_twin_artifacts")
    kept = KeptTwins(_folder(config) / folder if folder else None, tmp_path_factory.mktemp)
    config.stash[_kept] = kept
    return kept


@pytest.fixture(scope="session")
def twin_factory(_twins: KeptTwins) -> Callable[..., Twin]:
    """twin_factory(request, **changes): another twin, for a test or for a fixture of any scope.

    It is built from marker, ini keys and changes, and lives as long as the fixture or test of this `request`.
    """

    def make(request: pytest.FixtureRequest, **changes: Any) -> Twin:
        if _port(request.config):
            no_twin("twin_factory")
        twin = _twins.build(request.node, _call(request, changes, "twin_factory"))
        request.addfinalizer(lambda: _twins.forget(twin))
        return twin

    return make


@pytest.fixture
def twin(request: pytest.FixtureRequest, twin_call: dict[str, Any], _twins: KeptTwins) -> Iterator[Twin]:
    """A twin in this process, in virtual time, switched on."""
    given = _parameter(request)
    if _port(request.config):
        yield cast("Twin", NoTwin())
        return
    made = _twins.build(request.node, _call(request, {**twin_call, **given}, "twin") if given else twin_call)
    yield made
    _twins.forget(made)


@pytest.fixture
def watched(request: pytest.FixtureRequest, twin: Twin, twin_call: dict[str, Any]) -> Iterator[Watched | RealWatched]:
    """The same twin under observation, for the assertions of `isel_twin.jobs.checks.asserts`; it plays jobs, too. With
    --isel-port a real controller, of which replies and times are known."""
    if (port := _port(request.config)) is None:
        from isel_twin.jobs.checks.watched import Watched

        yield Watched(twin)
        return
    from isel_twin.base.errors import CallError
    from isel_twin.bridge.pytest.kept import built, called
    from isel_twin.bridge.pytest.real import RealWatched

    if twin_call.get("scenario"):
        no_twin("its scenario")
    names = built(called({**twin_call, "plant": "kinematic"}))
    real, wrong = None, ""
    try:
        real = RealWatched(port, names)
    except CallError as error:
        wrong = str(error)
    if real is None:  # outside of the `except`, which would make more than a line of it
        _wrong(f"--isel-port: {wrong}")
        return
    yield real
    real.close()
    if real.unseen:
        request.config.stash.setdefault(_overlooked, {})[request.node.nodeid] = list(real.unseen)
        request.node.user_properties.append(("isel_twin_not_looked_at", ", ".join(real.unseen)))


@pytest.fixture
def twin_serial(twin: Twin) -> Iterator[Serial]:
    """An open pySerial port with the same twin at its other end; its timeout is 60 s of virtual time."""
    from isel_twin.bridge.virtual.protocol_twin import Serial

    port = Serial.on(twin, timeout=60.0)
    yield port
    port.close()


@pytest.fixture
def twin_server(request: pytest.FixtureRequest, twin_call: dict[str, Any], _twins: KeptTwins) -> Iterator[ServedTwin]:
    """A twin served on a free port for a host in any language, and operated by `ask`. As fast as possible."""
    from isel_twin.bridge.pytest.kept import ServedTwin

    if _port(request.config):
        no_twin("twin_server")
    call = dict(twin_call)
    endpoint, speed = call.pop("endpoint", "tcp"), call.pop("speed", "max")
    made = _twins.build(request.node, call, line_speed=str(speed) != "max")
    served, wrong = None, ""
    try:
        served = ServedTwin(made, endpoint, str(speed))
    except ValueError as error:
        wrong = str(error)
    if served is None:  # outside of the `except`, which would make more than a line of it
        _twins.forget(made)
        _wrong(f"pytest.mark.twin: {wrong}")
        return
    yield served
    try:
        served.stop()
    finally:
        _twins.forget(made)


@pytest.fixture
def linuxcnc(request: pytest.FixtureRequest, twin_call: dict[str, Any], _twins: KeptTwins) -> Iterator[LinuxCnc]:
    """linuxcnc("my.ini", mdi="G1 F600 X20"): LinuxCNC, unmodified, homes and moves a served twin (docs/connections.md).

    Its `served` is the twin, as in `twin_server`. Skips where LinuxCNC is not installed.
    """
    from isel_twin.bridge.linuxcnc.session import lacking
    from isel_twin.bridge.pytest.kept import ServedTwin
    from isel_twin.bridge.pytest.linuxcnc import LinuxCnc
    from isel_twin.language import set_points_language

    if _port(request.config):
        no_twin("linuxcnc")
    if lacks := lacking():
        pytest.skip(lacks)
    controller, language = set_points_language()
    overrides = {**language.unwatched, **twin_call.get("overrides", {})}
    call = {key: value for key, value in twin_call.items() if key not in OF_SERVERS}
    made = _twins.build(request.node, {**call, "controller": controller, "overrides": overrides})
    served = ServedTwin(made)
    yield LinuxCnc(served, request.path.parent)
    try:
        served.stop()
    finally:
        _twins.forget(made)


@pytest.fixture
def virtual_host(twin: Twin) -> Callable[..., HostRun]:
    """virtual_host(["host.py", "--port", "COM4"], port="COM4"): an unmodified Python host drives the same twin.

    In virtual time, by `isel_twin.bridge.virtual.virtual_host.run_host`. What it prints is captured as the test's.
    """

    def run(argv: Any, port: str | None = None, **options: Any) -> HostRun:
        if isinstance(twin, NoTwin):
            no_twin("virtual_host")
        from isel_twin.bridge.virtual.virtual_host import run_host

        twin.line_speed = True
        if isinstance(argv, str | os.PathLike):
            argv = [argv]
        words = [os.fspath(word) for word in argv] if isinstance(argv, list | tuple) else argv
        return run_host(twin, words, port, **options)

    return run


# What a failing test leaves


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Any:
    report = yield
    if report.failed and (kept := item.config.stash.get(_kept, None)) is not None:
        funcargs = getattr(item, "funcargs", {})
        text, recordings = kept.tell(item, funcargs.get("tmp_path"))
        if text:
            report.sections.append(("isel-twin", text))
        item.user_properties += [("isel_twin_recording", str(path)) for path in recordings]  # for JUnit's XML
    return report
