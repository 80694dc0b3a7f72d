"""What stands beside a twin: what it costs the twin, and a row of another control.

Targets (docs/performance.md): the server's thread spends at most 2 % more CPU with a control port, or a panel that
nobody looks at; ten states a second, which an MTConnect adapter or an OPC UA server asks for, cost it at most 2 % of a
second; a row of another control costs at most 0.15 ms.
"""

from __future__ import annotations

import statistics
import threading
import time
from typing import Any

import pytest

from isel_twin import Twin
from isel_twin.bridge.operate.client import Client
from isel_twin.bridge.operate.control_port import ControlPort
from isel_twin.bridge.operate.panel.guest import Panel
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.server import Guest, Server

MOVES = b"@0A40000,10000,40000,10000,40000,10000,0,30\r@0A-40000,10000,-40000,10000,-40000,10000,0,30\r" * 8
INTERVAL_S = 0.1
FREE = "127.0.0.1:0"
ASKED = 200


def ready() -> Twin:
    twin = Twin(start_mm=(5.0, 5.0, 5.0))
    for command in ("@07", "@0R7", "@0z1", "@0A100,1000,0,30,0,30,0,30"):
        assert twin.query(command) == "0"
    return twin


def served_s(guests: list[Guest]) -> float:
    """CPU time of the server's thread for the moves, at speed max."""
    twin = ready()
    server = Server(twin, Pacer(None, twin.time_ns), [], guests=guests)
    twin.write(MOVES)

    def end() -> None:
        while not twin.idle:
            time.sleep(0.02)
        server.stop()

    thread = threading.Thread(target=end)
    thread.start()
    began = time.thread_time()
    server.run()
    spent = time.thread_time() - began
    thread.join()
    return spent


@pytest.mark.benchmark(group="beside a twin")
def test_who_only_waits_costs_nothing(benchmark: Any) -> None:
    """The same moves alone, with a control port, with a panel without a browser; in turn, least of each."""
    turns: list[tuple[float, ...]] = []

    def turn() -> None:
        turns.append((served_s([]), served_s([ControlPort(FREE)]), served_s([Panel(FREE)])))

    benchmark.pedantic(turn, rounds=16, warmup_rounds=1)  # two per cent ask for many on a busy computer
    alone, port, panel = (min(column) for column in zip(*turns[1:], strict=True))
    benchmark.extra_info["control port over none"] = port / alone
    benchmark.extra_info["panel without a browser over none"] = panel / alone
    assert port / alone <= 1.02
    assert panel / alone <= 1.02


@pytest.mark.benchmark(group="beside a twin")
def test_a_state(benchmark: Any) -> None:
    """What the server's thread spends on one answer to {"state": true}, of which adapters ask for ten a second."""
    spans: list[float] = []

    def states() -> None:
        port = ControlPort(FREE)
        server = Server(ready(), Pacer(None), [], guests=[port])

        def ask() -> None:
            with Client(port.address) as client:
                for _ in range(ASKED):
                    client.ask({"state": True})
            server.stop()

        thread = threading.Thread(target=ask)
        thread.start()
        began = time.thread_time()
        server.run()
        spans.append((time.thread_time() - began) / ASKED)
        thread.join()

    benchmark.pedantic(states, rounds=3)
    benchmark.extra_info["ms a state"] = min(spans) * 1e3
    assert min(spans) <= 0.02 * INTERVAL_S


@pytest.mark.benchmark(group="beside a twin")
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_a_row_of_another_control(benchmark: Any, plant: str) -> None:
    twin = Twin(controller="external", plant=plant, start_mm=(100.0, 100.0, 50.0))
    twin.query("out power_request=1 stages=1 brake=1")
    at = 0
    spans: list[float] = []

    def rows() -> None:
        nonlocal at
        began = time.process_time()
        for _ in range(300):
            at += 4
            assert twin.query(f"row 1000000 {at} 0 0").startswith("ok")
        spans.append((time.process_time() - began) / 300)

    benchmark.pedantic(rows, rounds=12, warmup_rounds=2)
    benchmark.extra_info["ms a row, median"] = statistics.median(spans) * 1e3
    benchmark.extra_info["ms a row, least"] = min(spans) * 1e3
    assert min(spans) <= 0.15e-3
