"""Whatever host, operator and wires do: the firmware never raises, never answers outside the manual, never lies.

The desk itself checks after every event that the counters equal the sum of the stream since they were last set, and
that the protocol of time is kept.
"""

from __future__ import annotations

import hypothesis.strategies as st
from hypothesis import HealthCheck, settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from isel_twin.controller import Controller
from isel_twin.testing import Desk
from tests.thorough import drawn

CODES = "0123456789DFGHR"
"""Manual section 5, without the codes it calls unused."""

steps = st.integers(-3000, 3000) | st.sampled_from([0, 1, -1, 200_000, -200_000, 8_388_607, 8_388_608])
speeds = st.sampled_from([30, 250, 900, 5000, 40_000, 29, 40_001])
small = st.integers(-2, 16)


def numbers(*parts: st.SearchStrategy[int]) -> st.SearchStrategy[str]:
    """Comma-separated numbers drawn from these strategies."""
    return st.tuples(*parts).map(lambda values: ",".join(map(str, values)))


pairs = st.lists(st.tuples(steps, speeds), min_size=1, max_size=4).map(lambda p: ",".join(f"{n},{v}" for n, v in p))
arc = numbers(st.integers(0, 4000), speeds, small, steps, steps, st.sampled_from([1, -1]), st.sampled_from([1, -1, 0]))
watch = numbers(st.integers(0, 3), st.sampled_from([0, 1, 255]), st.integers(0, 255))

moving = st.one_of(
    pairs.map("@0A{}".format),
    pairs.map("@0M{}".format),
    arc.map("@0y{}".format),
    st.tuples(arc, steps).map(lambda t: f"@0w{t[0]},{t[1]}"),
    numbers(small, small, small, speeds, steps, steps, steps).map("@0Z{}".format),
    st.sampled_from(["@0R7", "@0R1", "@0R4", "@0R8", "@0F1", "@0F7", "@0S", "@0N7", "@0N8"]),
)
setting = st.one_of(
    st.sampled_from(
        ["@07", "@03", "@08", "@01", "@02", "@0z1", "@0z0", "@0T1", "@0T0", "@0e1", "@0f-1", "@0n7", "@0k"]
    ),
    numbers(st.sampled_from([0, 1, 2, 3, 4, 5, 6, 100, 101]), st.sampled_from([0, 1, 255])).map("@0B{}".format),
    st.sampled_from(["@0P", "@0b0", "@0b3", "@0DRp", "@0DRn", "@0DS0", "@0V", "@0U", "@0H", "@0h", "@0d500,500,500"]),
    st.tuples(st.sampled_from("eDRT"), st.integers(0, 15)).map(lambda t: f"@0I{t[0]}{t[1]}"),
    st.tuples(st.sampled_from("AHN"), watch).map(lambda t: f"@0I{t[0]}{t[1]}"),
    st.sampled_from(
        ["@0IE57343", "@0IE0", "@0IO1", "@0IO0", "@0IW", "@0IL", "@0IX", "@0IC1", "@0IUfuzz", "@0J1", "@0j20"]
    ),
)
storable = st.one_of(
    pairs.map("0{}".format),
    pairs.map("m{}".format),
    arc.map("y{}".format),
    numbers(st.integers(0, 3), st.integers(-4, 4)).map("3{}".format),
    numbers(small, st.sampled_from([0, 128]), st.integers(0, 1), st.integers(-3, 3)).map("o{}".format),
    st.sampled_from(["5 2", "133", "233,1", "60,0,1", "71", "p0,0,1", "g1", "N7", "n1", "z1", "T1", "9", "x"]),
)
garbage = st.binary(max_size=20).map(lambda b: b.decode("latin-1").replace("\r", ""))

ELEMENTS = [
    ("hood", ["open", "closed", "forced"]),
    ("estop", ["pressed", "released"]),
    ("key", ["setup", "automatic"]),
    ("power", ["off", "on"]),
    ("start", ["down", "up"]),
    ("stop", ["down", "up"]),
    ("overtemperature", ["hot", "normal"]),
    ("user_0", ["high", "low"]),
    ("limit_x1", ["open", "free"]),
    ("limit_y2", ["open", "free"]),
    ("limit_z1", ["closed", "free"]),
    ("p2.5", ["free"]),
]
operations = st.sampled_from([(name, state) for name, states in ELEMENTS for state in states])


class AnyHost(RuleBasedStateMachine):
    """Random sessions at a desk."""

    def __init__(self) -> None:
        super().__init__()
        self.desk = Desk.of("imc-s8", settings={"program_memory_bytes": 200})

    @property
    def controller(self) -> Controller:
        return self.desk.controller

    @rule(commands=st.lists(moving | setting, min_size=1, max_size=3), seconds=st.sampled_from([0.0, 0.003, 0.2]))
    def host_sends(self, commands: list[str], seconds: float) -> None:
        self.desk.send("".join(f"{command}\r" for command in commands).encode("latin-1"))
        self.desk.run(seconds)

    @rule(lines=st.lists(storable, max_size=6))
    def host_stores_and_starts(self, lines: list[str]) -> None:
        self.desk.send("".join(f"{line}\r" for line in ["@0k", "@0i", *lines, "9", "@0S"]).encode("latin-1"))
        self.desk.run(3.0)

    @rule(text=garbage)
    def host_sends_garbage(self, text: str) -> None:
        self.desk.start(text)

    @rule(byte=st.sampled_from([253, 253, 255, 254]), seconds=st.sampled_from([0.0, 0.01]))
    def host_sends_control_byte(self, byte: int, seconds: float) -> None:
        self.desk.send(bytes([byte]))
        self.desk.run(seconds)

    @rule(operation=operations, seconds=st.sampled_from([0.0, 0.001, 0.1]))
    def operator_does(self, operation: tuple[str, str], seconds: float) -> None:
        self.desk.set(*operation)
        self.desk.run(seconds)

    @rule()
    def operator_makes_ready(self) -> None:
        for name, state in [("estop", "released"), ("overtemperature", "normal"), ("hood", "closed"), ("power", "on")]:
            self.desk.set(name, state)
        self.desk.send(b"\xff\r@07\r@0N7\r")
        self.desk.run(0.01)

    @rule(seconds=st.sampled_from([0.0005, 0.05, 1.0]))
    def time_passes(self, seconds: float) -> None:
        self.desk.run(seconds)

    @rule()
    def mains_fail(self) -> None:
        self.desk.power_cycle(0.1)

    @invariant()
    def replies_are_the_manuals(self) -> None:
        for _, data in self.desk.replies:
            text = data.decode("latin-1")
            assert text in (*CODES, "!") or text.startswith("0") or text.endswith("\r\n0"), text

    @invariant()
    def no_step_without_stages(self) -> None:
        assert self.desk.steps_without_stages == 0

    @invariant()
    def no_run_without_supply(self) -> None:
        if self.controller.run is not None:
            assert self.desk.levels["p2.1"]
            assert self.desk.levels["p1.0"]

    @invariant()
    def idle_means_nothing_to_come(self) -> None:
        if self.controller.idle:
            assert self.controller.run is None


TestAnyHost = AnyHost.TestCase
TestAnyHost.settings = settings(
    max_examples=drawn(60), stateful_step_count=25, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
