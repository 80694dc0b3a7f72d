"""Labels of the panel say what is so, whoever brings it about: a host, a scenario, the control port."""

from __future__ import annotations

import itertools
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import serial
from playwright.sync_api import Page, expect

from tests.panel.conftest import WAIT_S, Bench

pytestmark = [
    pytest.mark.usefixtures("chromium"),
    pytest.mark.long(seconds=20),
]


@pytest.fixture
def page(empty_page: Page) -> Page:
    """Without the machine in 3D."""
    empty_page.route("**/scene", lambda route: route.fulfill(body="<!doctype html>", content_type="text/html"))
    return empty_page


@contextmanager
def host_of(bench: Bench) -> Iterator[serial.Serial]:
    with serial.serial_for_url(f"socket://{bench.line.address}", timeout=WAIT_S) as host:
        yield host


def test_a_host_moves_the_machine(bench, page: Page) -> None:
    """X at 4000 steps/s, and at rest when it is stopped."""
    here = bench(speed=1.0, ready=True)
    page.goto(here.panel.url)
    expect(page.locator("#doings")).to_have_text("at rest")
    with host_of(here) as host:
        host.write(b"@0A80000,4000,0,30,0,30,0,30\r")
        expect(page.locator("#doings")).to_have_text("moving: x 4000 steps/s")
        expect(page.locator("#link")).to_have_text("host on tcp")
        host.write(b"\xfd")  # stop
        expect(page.locator("#doings")).to_have_text("at rest")
    expect(page.locator("#link")).to_have_text("connected")


def test_somebody_moves_it_by_the_keys_of_the_control(bench, browser, page: Page) -> None:
    """As `isel-twin ctl` does."""
    here = bench(controller="bwo900", machine="4030-servo", speed=1.0, ready=True)
    page.goto(here.panel.url)
    other = browser(here)
    expect(page.locator("#doings")).to_have_text("at rest")
    other.ask(key={"move": "+"})
    expect(page.locator("#doings")).to_have_text(re.compile(r"moving: x \d+ steps/s"))
    other.ask(key={"move": "off"})
    expect(page.locator("#doings")).to_have_text("at rest")


def test_a_scenario_pushes_a_machine_without_power(bench, browser, page: Page, tmp_path: Path) -> None:
    """No step is made, and yet it moves; each text is taken down, as it may be gone when it is looked for."""
    scenario = tmp_path / "push.toml"
    scenario.write_text("[[event]]\nat = 0.1\nforce_n.x = 150.0\n[[event]]\nat = 0.4\nforce_n.x = 0.0\n")
    here = bench(speed=0.1, plant="mujoco", scenario=scenario, paused=True)
    page.goto(here.panel.url)
    expect(page.locator("#doings")).to_have_text("at rest")
    page.evaluate(
        """() => {
          const told = [], doings = document.getElementById("doings");
          const take = () => { told.push(doings.textContent); document.body.dataset.told = told.join("; "); };
          new MutationObserver(take).observe(doings, { childList: true });
        }"""
    )
    browser(here).ask(resume=True)
    told = re.compile(r"^moving without steps: x -?\d+\.\d mm/s; .*at rest$")
    expect(page.locator("body")).to_have_attribute("data-told", told)


def test_eight_times_real_time_is_not_behind_it(bench, page: Page) -> None:
    """A look takes 0.1 ms each 10 ms: 100 times real time at most, where 1000 were asked for."""
    here = bench(speed=1000.0, look=lambda _: time.sleep(1e-4))
    page.goto(here.panel.url)
    pace = page.locator("#pace")
    expect(pace).to_have_text(re.compile(r"^× \d+\.\d+, not × 1000$"))
    expect(pace).to_have_attribute("data-state", "slow")
    assert 1.0 < float(pace.inner_text().split()[1].rstrip(",")) < 101.0
    expect(page.locator("#link")).to_have_attribute("data-state", "on")
    expect(page.locator("#link")).to_have_text("connected")


def test_half_of_real_time_is_behind_it(bench, page: Page) -> None:
    """A look takes 20 ms each 10 ms."""
    page.goto(bench(speed=1.0, look=lambda _: time.sleep(0.02)).panel.url)
    expect(page.locator("#pace")).to_have_text(re.compile(r"^behind real time: × 0\.[0-5]\d$"))
    expect(page.locator("#pace")).to_have_attribute("data-state", "lost")


def test_least_margins_begin_anew(bench, browser, page: Page) -> None:
    """By the button, and by whoever else asks: a motor at rest has more left than it had on the way."""
    here = bench(speed=20.0, plant="mujoco", ready=True)
    page.goto(here.panel.url)
    least, since = page.locator("[data-axis=x] td:nth-child(8)"), page.locator("#since")
    expect(page.locator("#axes th:nth-child(8)")).to_have_text("least margin")
    expect(least).to_have_text(re.compile(r"^0\.\d\d \(0\.\d\d to 0\.\d\d\)$"))  # and its band
    expect(since).to_have_text("0.000")
    before = least.inner_text()
    page.locator("#anew").click()
    expect(since).not_to_have_text("0.000")
    expect(least).not_to_have_text(before)
    assert float(least.inner_text().split()[0]) > float(before.split()[0])
    other = browser(here)
    told = since.inner_text()
    assert f"{other.frame['margin_since_s']:.3f}" == told
    other.ask(watch_margin=True)
    expect(since).not_to_have_text(told)


def test_a_job_that_was_made_to_its_end_is_not_called_well(bench, page: Page, tmp_path: Path) -> None:
    """It is said what was looked at: whether a command was refused."""
    job = tmp_path / "short.txt"
    job.write_text("@0A 160,800,0,30,0,30,0,30\n")
    page.goto(bench(ready=True).panel.url)
    page.locator("[data-tab=job]").click()
    page.locator("#file").set_input_files(job)
    page.locator("#start").click()
    expect(page.locator("#doing")).to_contain_text("all lines accepted, 1 of 1 commands")


def test_plots_show_what_lies_between_two_frames_and_no_line_where_nobody_looked(bench, browser) -> None:
    """At speed max a move of four seconds takes a frame or two; 5000 Hz were commanded."""
    here = bench(ready=True)
    first = browser(here)
    with host_of(here) as host:
        for command in (b"@0A16000,5000,0,30,0,30,0,30\r", b"@0A-16000,4000,0,30,0,30,0,30\r"):
            host.write(command)
            assert host.read(1) == b"0"
        end_s = here.twin.time_ns / 1e9
        first.until(lambda: first.plots[-1][1] >= end_s)
        assert max(point[3][0] for point in first.plots) == pytest.approx(5000.0, rel=0.01)
        assert min(point[2][0] for point in first.plots) == pytest.approx(-4000.0, rel=0.01)
        assert all(after[0] == before[1] for before, after in itertools.pairwise(first.plots))
        first.close()
        until_s = time.monotonic() + WAIT_S
        while here.panel._site.watched:
            assert time.monotonic() < until_s
            time.sleep(0.01)
        host.write(b"@0A16000,5000,0,30,0,30,0,30\r")
        assert host.read(1) == b"0"
        unseen_s = here.twin.time_ns / 1e9 - 1.0
    plots = browser(here).plots
    gaps = [(before[1], after[0]) for before, after in itertools.pairwise(plots) if after[0] != before[1]]
    assert len(gaps) == 1
    assert gaps[0][0] <= end_s < unseen_s < gaps[0][1]
