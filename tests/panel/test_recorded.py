"""A recording in a real browser: the page stands alone, and what it shows is what was recorded, to the nanosecond."""

from __future__ import annotations

import http.client
import json
import signal
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from isel_twin import Twin
from isel_twin.capture.load import load
from isel_twin.plant.scene import Poses
from isel_twin.recordings.places import places
from isel_twin.recordings.reading import Recorded, read
from isel_twin.recordings.recording import FileRecording
from isel_twin.report import playback
from tests.forked import start
from tests.in_process import isel_twin
from tests.near import NEAR
from tests.panel.conftest import LOOPBACK, WAIT_S

pytestmark = [
    pytest.mark.usefixtures("chromium"),
    pytest.mark.long(seconds=13),
]

JOB = "@07\n@0R7\n@0A16000,5000,8000,5000,0,30,0,30\n@0A-3200,1000,0,30,0,30,0,30\n"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("session")
    (folder / "job.txt").write_text(JOB)
    file = folder / "session.mcap"
    done = isel_twin("run", folder / "job.txt", "--plant", "kinematic", *NEAR, "--record", file)
    assert done.returncode == 0, done
    assert isel_twin("panel", file, "--html", folder / "session.html").returncode == 0
    return file


@pytest.fixture(scope="module")
def recorded(recording: Path) -> Recorded:
    return read(recording)


@dataclass
class Opened:
    """A page with what it has said and asked for."""

    page: Page
    wrong: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def opened(recording: Path, chromium: Browser) -> Iterator[Opened]:
    """The file, without a network."""
    with chromium.new_context(offline=True) as context:
        context.set_default_timeout(WAIT_S * 1000)
        here = Opened(context.new_page())
        here.page.on("console", lambda line: line.type == "error" and here.wrong.append(line.text))
        here.page.on("pageerror", lambda error: here.wrong.append(str(error)))
        here.page.on("request", lambda request: here.asked.append(request.url))
        here.page.goto(recording.with_suffix(".html").as_uri())
        expect(here.page.locator("body")).to_have_attribute("data-ready", "true", timeout=WAIT_S * 1000)
        yield here


@pytest.fixture
def page(opened: Opened, recording: Path) -> Iterator[Page]:
    """The file at its beginning; nothing goes wrong and nothing is asked for while it is used."""
    expect.set_options(timeout=WAIT_S * 1000)
    opened.page.set_viewport_size({"width": 1280, "height": 800})
    opened.page.evaluate("go_to(0)")
    yield opened.page
    assert opened.wrong == []
    assert {address for address in opened.asked if not address.startswith("blob:")} == {
        recording.with_suffix(".html").as_uri()
    }


def test_steps_samples_and_times_are_those_of_the_recording(page: Page, recorded: Recorded) -> None:
    told = page.evaluate(
        """() => {
          const { times, ticks, samples } = session;
          const position = samples.find((one) => one.name === "position_mm").values.map((one) => [...one]);
          return { times: [...times], ticks: [...ticks.times], x: [...ticks.moved[0]], position };
        }"""
    )
    steps = recorded.steps()
    assert np.array_equal(np.rint(np.array(told["ticks"]) * 1e9), steps.t_ns)
    assert np.array_equal(told["x"], steps.delta[:, 0])
    last = np.append(np.diff(recorded.sample_times_ns) > 0, True)
    assert np.array_equal(np.rint(np.array(told["times"]) * 1e9), recorded.sample_times_ns[last])
    assert np.abs(np.array(told["position"]).T - recorded.samples["position_mm"][last]).max() < 0.501e-4


def test_the_machine_stands_where_it_stood(page: Page, recorded: Recorded) -> None:
    """Frames of all bodies as MuJoCo has them; at the end behind the reference run at X 50 - 10 mm, Y 25 mm."""
    machine = places(recorded)
    poses = Poses(machine.model, [axis.name for axis in machine.machine.axes])
    told = page.evaluate(
        """() => ({ frames: frames(session.machine.bodies, [0.11, 0.07, 0.03]), end: places_at(session, session.end),
                    names: session.machine.bodies.map((body) => body.name) })"""
    )
    for name, pose in poses.at([110.0, 70.0, 30.0]).items():
        frame = np.array(told["frames"][told["names"].index(name)]).reshape(4, 4)
        assert frame[3, :3] == pytest.approx(pose.position, abs=1e-6)
    assert np.array(told["end"]) == pytest.approx([0.040, 0.025, 0.0], abs=1e-3)


def test_a_trigger_finds_the_edge_and_cursors_measure(page: Page, recorded: Recorded) -> None:
    """The switch of X is struck when it was; two steps at 1000 Hz are 1 ms apart."""
    (struck_ns, *_) = (e.time_ns for e in recorded.of("/inputs") if e.content.get("limit_x1") == "struck")
    page.locator("#trigger").select_option("input limit_x1")
    page.locator("#edge").select_option("becomes")
    page.locator("#level").fill("struck")
    page.locator("#next").click()
    expect(page.locator("#now")).to_have_text(f"{struck_ns / 1e9:.6f} s")
    page.locator("#trigger").select_option("serial line and events")
    page.locator("#level").fill("@0A-3200")
    page.locator("#next").click()
    expect(page.locator("#lines [aria-current] code")).to_have_text("@0A-3200,1000,0,30,0,30,0,30")
    page.locator("#trigger").select_option("step x")
    page.locator("#edge").select_option("any step")
    page.evaluate("go_to(session.end - 1)")  # in the stretch of even speed
    page.locator("#next").click()
    page.locator("#cursor-a").click()
    page.locator("#next").click()
    page.locator("#cursor-b").click()
    expect(page.locator("#cursors")).to_contain_text("dt 0.0010000 s  1/dt 1000.00 Hz")


def test_the_scope_tells_the_fastest_steps_as_they_were_commanded(page: Page) -> None:
    """Whatever a pixel holds of them. X moves 16000 steps at 5000 Hz, and Y 8000 beside it: 2500 Hz."""
    told = page.evaluate(
        """async () => {
          const texts = [], plain = CanvasRenderingContext2D.prototype.fillText;
          CanvasRenderingContext2D.prototype.fillText = function (text, ...where) {
            texts.push(text);
            plain.call(this, text, ...where);
          };
          go_to(session.end);
          while (!texts.length) await new Promise(requestAnimationFrame);
          CanvasRenderingContext2D.prototype.fillText = plain;
          return texts.filter((text) => text.endsWith("steps/s"));
        }"""
    )
    assert told[:2] == ["5000 steps/s", "2500 steps/s"]


def test_a_saved_window_is_a_dump_that_drive_takes(page: Page, recorded: Recorded, tmp_path: Path) -> None:
    """From cursor A to B: the steps of X and Y and their directions, and nothing before or after."""
    page.evaluate("go_to(session.end - 3.0)")
    page.locator("#cursor-a").click()
    page.evaluate("go_to(session.end - 2.9)")
    page.locator("#cursor-b").click()
    with page.expect_download() as saving:
        page.locator("#vcd").click()
    file = tmp_path / "window.vcd"
    saving.value.save_as(file)
    begin, end = page.evaluate("[session.end - 3.0, session.end - 2.9].map((t) => Math.round(t * 1e9))")
    steps = recorded.steps()
    inside = (steps.t_ns >= begin) & (steps.t_ns <= end) & (steps.delta[:, 0] != 0)
    ticks = load(file)
    moved = ticks.delta[:, 0] != 0
    assert inside.sum() > 50
    assert np.array_equal(ticks.t_ns[moved], steps.t_ns[inside])
    assert np.array_equal(ticks.delta[moved, 0], steps.delta[inside, 0])


def test_it_plays_to_its_end(page: Page, recorded: Recorded) -> None:
    page.locator("#speed").select_option("20")
    page.locator("#play").click()
    expect(page.locator("#now")).to_have_text(f"{recorded.end_ns / 1e9:.6f} s")
    expect(page.locator("#play")).to_have_text("Play")
    expect(page.locator("#lines li").last).to_have_attribute("aria-current", "true")


@pytest.mark.parametrize(("width", "scheme"), [(1024, "light"), (390, "dark")])
def test_it_is_usable_at_each_width(page: Page, width: int, scheme: str) -> None:
    """Nothing sticks out to the right, and axe finds nothing serious."""
    page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
    page.set_viewport_size({"width": width, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    found = Axe().run(page).response["violations"]
    assert [one["id"] for one in found if one["impact"] in ("serious", "critical")] == []


def test_what_does_not_fit_is_left_out_and_told(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of samples, the half at first, but not their extremes: here of a session that is short."""
    monkeypatch.setattr(playback, "LEAST_SAMPLES", 100)
    size = recording.with_suffix(".html").stat().st_size
    out = tmp_path / "small.html"
    done = isel_twin("panel", recording, "--html", out, "--most", f"{(size - 100) / 1e6:.6f}", "--json")
    told = json.loads(done.stdout)
    assert told["left_out"] == ["of 4 samples, all but the least and largest, for the size of the file"]
    assert told["bytes"] == out.stat().st_size <= size - 100
    done = isel_twin("panel", recording, "--html", tmp_path / "none.html", "--most", "0.01")
    assert (done.returncode, done.stderr.strip()) == (
        2,
        f"isel-twin: {recording}: is too long for a page of 0.01 MB",
    )
    assert not (tmp_path / "none.html").exists()


def test_what_began_in_the_middle_is_shown_without_the_machine(tmp_path: Path, empty_page: Page) -> None:
    """Nobody knows where it stood; line, steps and samples are there."""
    twin = Twin(plant="kinematic")
    twin.query("@07")
    twin.run(1.0)
    recording = FileRecording(tmp_path / "late.mcap", twin, 10_000_000)
    twin.query("@0A160,800,0,30,0,30,0,30")
    recording.close()
    done = isel_twin("panel", tmp_path / "late.mcap", "--html", tmp_path / "late.html", "--json")
    (left_out,) = json.loads(done.stdout)["left_out"]
    assert left_out.startswith("the machine in 3D: the recording does not begin at power-on")
    page = empty_page
    page.goto((tmp_path / "late.html").as_uri())
    expect(page.locator("body")).to_have_attribute("data-ready", "true")
    expect(page.locator("#stage")).to_contain_text("does not say where the machine was")
    assert isel_twin("export", tmp_path / "late.mcap", tmp_path / "view.mcap").returncode == 2


def test_it_is_served_to_this_computer_only(recording: Path) -> None:
    process = start("panel", str(recording), "--address", LOOPBACK)
    try:
        address = json.loads(process.stdout.readline())["panel"].removeprefix("http://").rstrip("/")
        answers = []
        for host, path in ((address, "/"), ("elsewhere.invalid", "/"), (address, "/none")):
            connection = http.client.HTTPConnection(address, timeout=WAIT_S)
            connection.request("GET", path, headers={"Host": host})
            response = connection.getresponse()
            answers.append((response.status, b'id="session"' in response.read()))
            connection.close()
        assert answers == [(200, True), (403, False), (404, False)]
    finally:
        process.send_signal(signal.SIGTERM)
        assert process.wait(WAIT_S) == 0


def test_set_points_are_saved_as_commands(empty_page: Page, tmp_path: Path) -> None:
    """Of a card that leads servo drives: the sum of what was commanded, at each set point, and no pulses."""
    (tmp_path / "job.txt").write_text("Q7;1\nf2000\nM5000\n81h 9000\n")
    call = ("--controller", "gmi99", "--machine", "4030-servo", "--plant", "kinematic")
    file = tmp_path / "led.mcap"
    assert isel_twin("run", tmp_path / "job.txt", *call, "--record", file).returncode == 0
    assert isel_twin("panel", file, "--html", tmp_path / "led.html").returncode == 0
    page = empty_page
    page.goto((tmp_path / "led.html").as_uri())
    expect(page.locator("body")).to_have_attribute("data-ready", "true")
    with page.expect_download() as saving:
        page.locator("#vcd").click()
    saving.value.save_as(tmp_path / "led.vcd")
    text = (tmp_path / "led.vcd").read_text()
    assert "step_x" not in text
    code = text.split(" command_x $end")[0].rsplit(" ", 1)[1]
    values = [
        float(line[1:].split()[0]) for line in text.splitlines() if line.startswith("r") and line.endswith(f" {code}")
    ]
    assert values[-1] == read(file).steps().delta[:, 0].sum()
