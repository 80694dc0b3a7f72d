"""The panel in a real browser: what people press, type and see. Nothing sleeps; all waits are for what is expected."""

from __future__ import annotations

import itertools
import json
import math
import re
import signal
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import serial
from playwright.sync_api import Browser, Locator, Page, expect

from tests.forked import start
from tests.in_process import isel_twin
from tests.panel.conftest import LOOPBACK, WAIT_S, Bench

pytestmark = [
    pytest.mark.usefixtures("chromium"),
    pytest.mark.long(seconds=35),
]

EMPTY = '<!doctype html><html lang="en"><title>no scene</title><main><h1>no scene</h1></main></html>'
PARTS = ("header", "#operate", "#stage", "#axes", "#plots", "#trigger", "#upper", "#lower")
"""Of the page, beside or below each other."""

OPEN_S = 1.0
"""Of a processor, in which the page is to be there."""


@dataclass
class Opened:
    """A page with what it has said and asked for."""

    page: Page
    said: list[str] = field(default_factory=list)
    """Errors of the console and of scripts."""
    asked: list[str] = field(default_factory=list)
    """Addresses it has asked for, by whatever way."""

    def __getitem__(self, selector: str) -> Locator:
        return self.page.locator(selector)

    def say(self, text: str) -> None:
        self["#text"].fill(text)
        self["#text"].press("Enter")

    def message(self, who: str, text: str) -> Locator:
        found = self[f".message[data-who={who}]"]
        return found.filter(has=self.page.locator(".text", has_text=re.compile(f"^{text}$")))


@pytest.fixture
def open_panel(empty_page: Page) -> Callable[..., Opened]:
    """open_panel(bench) opens a page; without `scene` nothing is drawn in 3D, which takes long without a GPU."""
    pages = [empty_page]

    def start(bench: Bench, scene: bool = False) -> Opened:
        opened = Opened(pages.pop() if pages else empty_page.context.new_page())
        opened.page.on("console", lambda line: line.type == "error" and opened.said.append(line.text))
        opened.page.on("pageerror", lambda error: opened.said.append(str(error)))
        opened.page.on("request", lambda request: opened.asked.append(request.url))
        opened.page.on("websocket", lambda connection: opened.asked.append(connection.url))
        if not scene:
            opened.page.route("**/scene", lambda route: route.fulfill(body=EMPTY, content_type="text/html"))
        opened.page.goto(bench.panel.url)
        expect(opened["#link"]).to_have_attribute("data-state", "on")
        return opened

    return start


def test_the_emergency_stop_in_motion(bench, open_panel):
    """Lamp, reply and standstill: the stages lose their power, the controller tells error 9, the counter stands."""
    here = bench(speed=1.0, ready=True)
    page = open_panel(here)
    page.say("@0A 80000,800,0,800,0,800,0,800")
    expect(page['[data-output="moving"]']).to_have_attribute("data-on", "1")
    expect(page["[data-axis=x] td:nth-child(6)"]).to_have_text("800")
    expect(page['[data-output="power"]']).to_have_attribute("data-on", "1")
    page['[data-element="estop"]'].click()
    expect(page['[data-element="estop"]']).to_have_attribute("aria-pressed", "true")
    expect(page['[data-output="power"]']).to_have_attribute("data-on", "0")
    expect(page['[data-port="p1.0"] .level']).to_have_text("low")
    expect(page.message("twin", "9")).to_be_visible()
    expect(page["[data-axis=x] td:nth-child(6)"]).to_have_text("0")
    stood = page["[data-axis=x] td:nth-child(2)"].inner_text()
    assert 0 < int(stood) < 80_000
    for _ in range(3):
        expect(page["#time"]).not_to_have_text(page["#time"].inner_text())
    assert page["[data-axis=x] td:nth-child(2)"].inner_text() == stood
    page['[data-element="estop"]'].click()
    expect(page.message("ctl", ".*estop.*")).to_have_count(2)
    expect(page['[data-element="estop"]']).to_have_attribute(
        "aria-pressed", "true"
    )  # a second click does not release it
    page['#elements [data-release="estop"]'].click()
    expect(page['[data-element="estop"]']).to_have_attribute("aria-pressed", "false")
    assert page.said == []


def test_the_edge_of_each_axis_is_seen(bench, open_panel):
    """A motor at half of the speed from which on a swing of its rotor grows has an edge of 2, beyond that speed one
    below 1, in red; Y, which has not moved since its reference run, keeps what it had."""
    here = bench(speed=5.0, ready=True, plant="mujoco")
    page = open_panel(here)
    axis = here.twin.machine.axes[0]
    limit_hz = axis.swing_limit_rad_s * axis.steps_per_rev / (2.0 * math.pi)
    edge = page["[data-axis=x] td:nth-child(9)"]
    expect(page["#axes th:nth-child(9)"]).to_have_text("least edge")
    page.say(f"@0A 64000,{round(limit_hz / 2.0)},0,30,0,30,0,30")
    expect(edge).to_have_text("2.00")
    expect(edge).not_to_have_class("lost")
    other = page["[data-axis=y] td:nth-child(9)"].inner_text()
    expect(page.message("twin", "0")).to_have_count(1)
    page.say(f"@0A -64000,{round(1.05 * limit_hz)},0,30,0,30,0,30")
    expect(edge).to_have_text("0.95")
    expect(edge).to_have_class("lost")
    expect(page["[data-axis=y] td:nth-child(9)"]).to_have_text(other)
    assert page.said == []


def test_a_recording_made_while_somebody_watches_is_replayed(empty_page: Page, tmp_path: Path) -> None:
    """The margins that a panel shows are not those that are recorded: each has a reader of its own."""
    file = tmp_path / "watched.mcap"
    process = start("serve", "--tcp", LOOPBACK, "--panel", LOOPBACK, "--record", str(file), "--speed", "20")
    try:
        info = json.loads(process.stdout.readline())
        page = empty_page
        page.route("**/scene", lambda route: route.fulfill(body=EMPTY, content_type="text/html"))
        page.goto(info["panel"])
        expect(page.locator("#link")).to_have_attribute("data-state", "on")
        with serial.serial_for_url(f"socket://{info['tcp']}", timeout=WAIT_S) as host:
            for command in ("@07", "@0N7", "@0A16000,12000,8000,6000,0,900,0,900", "@0A-8000,9000,0,900,0,900,0,900"):
                host.write(command.encode() + b"\r")
                assert host.read(1) == b"0", command
        expect(page.locator("[data-axis=x] td:nth-child(2)")).to_have_text("8000")
    finally:
        process.send_signal(signal.SIGTERM)
        assert process.wait(WAIT_S) == 0
    done = isel_twin("replay", file)
    assert done.returncode == 0, done


def test_a_trigger_pauses_the_machine_and_the_scope_shows_the_time_around_it(empty_page: Page, tmp_path: Path) -> None:
    """The switch of X is struck in the reference run: armed by the form, seen in the scope, gone on with."""
    file = tmp_path / "now.mcap"
    kinematic = ("--plant", "kinematic", "--speed", "50")
    process = start("serve", "--tcp", LOOPBACK, "--panel", LOOPBACK, "--record", str(file), *kinematic)
    try:
        info = json.loads(process.stdout.readline())
        page = empty_page
        page.route("**/scene", lambda route: route.fulfill(body=EMPTY, content_type="text/html"))
        page.goto(info["panel"])
        page.locator("#triggersignal").select_option(label="input limit x1")
        page.locator("#triggeract").select_option("becomes struck")
        page.locator("#arm").click()
        expect(page.locator("#triggered")).to_have_text("armed: input limit x1 becomes struck")
        for text in ("@07", "@0R7"):
            page.locator("#text").fill(text)
            page.locator("#text").press("Enter")
        expect(page.locator("#pause")).to_have_text("Go on")
        hit_s = float(page.locator("#triggered").inner_text().split(" s: ")[0])
        expect(page.locator("#time")).to_have_text(f"{hit_s:.3f}")
        expect(page.locator("#arm")).to_have_attribute("aria-pressed", "false")
        with page.context.expect_page() as opened:
            page.locator("#around").click()
        scope = opened.value
        expect(scope.locator("body")).to_have_attribute("data-ready", "true")
        shown = scope.evaluate("[now, session.end]")
        assert shown[0] == pytest.approx(hit_s, abs=1e-6)
        assert shown[1] == pytest.approx(hit_s, abs=0.02)
        page.locator("#pause").click()
        expect(page.locator("#pause")).to_have_text("Pause")
        expect(page.locator("#time")).not_to_have_text(f"{hit_s:.3f}")
        page.locator("#disarm").click()
        expect(page.locator("#triggered")).to_have_text("")
    finally:
        process.send_signal(signal.SIGTERM)
        assert process.wait(WAIT_S) == 0


def test_what_is_typed_before_the_answer_stays_and_what_is_refused_comes_back(bench, open_panel):
    here = bench()
    page = open_panel(here)
    field = page["#text"]
    page.page.evaluate("""() => {
        const field = document.getElementById("text");
        field.value = "@07";
        field.form.requestSubmit();
        field.value = "@0N7";
    }""")
    expect(page["#monitor [data-who=host]"]).to_have_count(1)
    expect(field).to_have_value("@0N7")
    field.press("Enter")
    expect(page["#monitor [data-who=host]"]).to_have_count(2)
    expect(field).to_have_value("")
    page.page.evaluate("""() => {
        socket.close();
        const field = document.getElementById("text");
        field.value = "@0P";
        field.form.requestSubmit();
    }""")
    expect(field).to_have_value("@0P")


def test_the_scope_shows_the_session_of_a_served_machine_up_to_now(empty_page: Page, tmp_path: Path) -> None:
    """In a tab of its own, from the recording that is made; the E-stop stays in sight where the page is scrolled."""
    file = tmp_path / "now.mcap"
    kinematic = ("--plant", "kinematic", "--speed", "max")
    process = start("serve", "--tcp", LOOPBACK, "--panel", LOOPBACK, "--record", str(file), *kinematic)
    try:
        info = json.loads(process.stdout.readline())
        with serial.serial_for_url(f"socket://{info['tcp']}", timeout=WAIT_S) as host:
            for command in ("@07", "@0N7", "@0A1600,800,0,30,0,30,0,30"):
                host.write(command.encode() + b"\r")
                assert host.read(1) == b"0", command
        page = empty_page
        page.set_viewport_size({"width": 1024, "height": 768})
        page.route("**/scene", lambda route: route.fulfill(body=EMPTY, content_type="text/html"))
        page.goto(info["panel"])
        expect(page.locator("[data-axis=x] td:nth-child(2)")).to_have_text("1600")
        header = page.locator("header").bounding_box()
        assert header is not None
        assert header["height"] < 60  # one row
        page.evaluate("scrollTo(0, 500)")
        expect(page.locator("#near [data-near=estop]")).to_be_in_viewport()
        with page.context.expect_page() as opened:
            page.locator("#scope").click()
        session = opened.value
        expect(session.locator("body")).to_have_attribute("data-ready", "true")
        expect(session.locator("#lines code").nth(4)).to_have_text("@0A1600,800,0,30,0,30,0,30")
    finally:
        process.send_signal(signal.SIGTERM)
        assert process.wait(WAIT_S) == 0


def test_open_the_hood_turn_the_key_press_the_probe_and_a_button(bench, open_panel):
    here = bench()
    page = open_panel(here)
    hood = page['.element[data-element="hood"]']
    hood.get_by_role("button", name="forced").click()
    expect(hood.get_by_role("button", name="open")).to_have_attribute("aria-pressed", "true")
    expect(page['[data-port="p2.5"] .level']).to_have_text("low")
    hood.get_by_role("button", name="closed").click()
    expect(hood.get_by_role("button", name="closed")).to_have_attribute("aria-pressed", "true")
    page['.element[data-element="key"]'].get_by_role("button", name="setup").click()
    expect(page['[data-port="p2.7"] .level']).to_have_text("high")
    page['.element[data-element="probe"]'].get_by_role("button", name="touched").click()
    expect(page['[data-port="p1.5"] .level']).to_have_text("high")
    page['.row [data-element="user_3"]'].click()
    expect(page['[data-port="p0.3"] .level']).to_have_text("high")
    start = page['.element[data-element="start"] .push']
    start.hover()
    page.page.mouse.down()
    expect(page['[data-port="p1.3"] .level']).to_have_text("high")
    page.page.mouse.up()
    expect(page['[data-port="p1.3"] .level']).to_have_text("low")
    assert page.said == []


def test_break_a_switch_and_heal_it_and_flip_bits(bench, open_panel):
    here = bench()
    page = open_panel(here)
    page["[data-tab=faults]"].click()
    page['[data-contact="limit_x2"] select'].select_option("broken")
    expect(page['.wrong[data-fault="limit_x2"]']).to_contain_text("broken")
    expect(page["#faulty"]).to_have_text("1")
    noise = page['.act[data-act="noise"]']
    noise.locator("summary").click()
    noise.get_by_label("noise: value").fill("0.25")
    noise.get_by_role("button", name="begin").click()
    expect(page['.wrong[data-fault="noise"]']).to_contain_text("0.25")
    page["[data-tab=ports]"].click()
    expect(page['[data-port="p3.1"] .level']).to_have_text("low")
    page["[data-tab=faults]"].click()
    for fault in ("limit_x2", "noise"):
        page[f'.wrong[data-fault="{fault}"]'].get_by_role("button", name="end").click()
        expect(page[f'.wrong[data-fault="{fault}"]']).to_have_count(0)
    page["[data-tab=ports]"].click()
    expect(page['[data-port="p3.1"] .level']).to_have_text("high")
    assert page.said == []


def test_a_fault_for_a_while_ends_by_itself(bench, open_panel):
    page = open_panel(bench(speed=1.0))
    page["[data-tab=faults]"].click()
    dropped = page['.act[data-act="dropped"]']
    dropped.locator("summary").click()
    dropped.get_by_label("dropped: for").fill("0.8")
    dropped.get_by_role("button", name="begin").click()
    expect(page['.wrong[data-fault="dropped"]']).to_have_count(1)
    expect(page['.wrong[data-fault="dropped"]']).to_have_count(0)
    assert page.said == []


def test_the_token_of_the_link_is_enough(bench, open_panel):
    here = bench(token="sesame")
    page = open_panel(here)
    page['[data-element="estop"]'].click()
    expect(page['[data-element="estop"]']).to_have_attribute("aria-pressed", "true")
    scene = page.page.request.get(f"http://{here.panel.address}/scene")
    assert scene.ok  # asked with the cookies of the page
    assert page.said == []


def test_a_query_typed_in_is_answered_and_explained(bench, open_panel):
    page = open_panel(bench(ready=True))
    page.say("@0P")
    expect(page.message("host", "@0P")).to_contain_text("position")
    expect(page.message("twin", "0000000000000000000")).to_be_visible()
    expect(page["#text"]).to_have_value("")
    page.say("€")
    expect(page["#told"]).to_contain_text("not a character a serial line can carry")
    assert page.said == []


def test_two_browsers_see_the_same_also_after_a_reload(bench, open_panel):
    here = bench(speed=1.0, ready=True)
    one, other = open_panel(here), open_panel(here)
    one['[data-element="estop"]'].click()
    expect(other['[data-element="estop"]']).to_have_attribute("aria-pressed", "true")
    other['.element[data-element="hood"]'].get_by_role("button", name="forced").click()
    expect(one['[data-port="p2.5"] .level']).to_have_text("low")
    one.say("@0P")
    expect(other.message("host", "@0P")).to_be_visible()
    one["#pause"].click()
    expect(other["#pause"]).to_have_text("Go on")
    paused_at = one["#time"].inner_text()
    other.page.get_by_role("button", name="step 100 ms").click()
    expect(one["#time"]).not_to_have_text(paused_at)
    expect(other["#time"]).to_have_text(one["#time"].inner_text())
    other.page.reload()
    expect(other['[data-element="estop"]']).to_have_attribute("aria-pressed", "true")
    expect(other.message("host", "@0P")).to_be_visible()
    expect(other["#time"]).to_have_text(one["#time"].inner_text())
    other["#speed"].select_option("max")
    expect(one["#speed"]).to_have_value("max")
    assert one.said == other.said == []


def test_the_state_is_saved_as_a_file(bench, open_panel):
    here = bench(ready=True)
    page = open_panel(here)
    with page.page.expect_download() as saved:
        page["#snapshot"].click()
    state = json.loads(saved.value.path().read_text(encoding="utf-8"))
    assert state["counts"] == here.twin.counts.tolist()
    assert state["inputs"]["estop"] == "released"


def test_with_the_scene_it_asks_nobody_else_says_no_error_and_stays_usable(bench, open_panel):
    """Twenty frames a second at `max`, and the machine in 3D; the scene has drawn the axes where they are."""
    here = bench(ready=True)
    page = open_panel(here, scene=True)
    page.page.set_viewport_size({"width": 800, "height": 300})  # little to draw: no GPU
    scene = page.page.frame_locator("#scene")
    expect(scene.locator("canvas").first).to_be_visible()
    page.say("@0A 8000,5000,4000,5000,0,800,0,800")
    expect(page["[data-axis=x] td:nth-child(2)"]).to_have_text("8000")
    page['[data-element="estop"]'].click()
    expect(page['[data-element="estop"]']).to_have_attribute("aria-pressed", "true")
    origin = urlsplit(here.panel.url)
    for address in page.asked:
        where = urlsplit(address.removeprefix("blob:"))
        assert where.scheme in ("http", "ws", "data"), address
        assert where.scheme == "data" or where.netloc == origin.netloc, address
    assert any(urlsplit(address).path == "/operate" for address in page.asked)
    assert page.said == []


def test_the_page_is_there_in_time(bench, open_panel):
    """From the request to the first frame, in seconds of the browser's processor, as the computer may be busy."""
    page = open_panel(bench())
    browser = page.page.context.new_cdp_session(page.page)
    browser.send("Performance.enable", {"timeDomain": "threadTicks"})

    def spent_s() -> float:
        return {one["name"]: one["value"] for one in browser.send("Performance.getMetrics")["metrics"]}["TaskDuration"]

    before_s = spent_s()
    page.page.reload(wait_until="commit")
    expect(page["#pad button"].first).to_be_visible()
    assert 0.0 < spent_s() - before_s < OPEN_S


@pytest.mark.parametrize("controller", ["imc-s8", "ismif"])
def test_one_page_for_every_controller_and_nothing_overlaps(bench, open_panel, controller: str):
    page = open_panel(bench(controller=controller))
    page["[data-tab=ports]"].click()
    expect(page["#ports .port"].first).to_be_visible()
    expect(page["#outputs .lamp"].first).to_be_visible()
    expect(page["#axes tbody tr"].first).to_be_visible()
    for width, height in ((1280, 800), (1920, 1080), (1000, 700)):
        page.page.set_viewport_size({"width": width, "height": height})
        boxes = {name: page[name].bounding_box() for name in PARTS}
        for name, box in boxes.items():
            assert box is not None, name
            assert box["width"] > 100, (width, name)
            assert box["height"] > 30, (width, name)
            assert box["x"] >= 0, (width, name)
            assert box["x"] + box["width"] <= width, (width, name)
        for one, other in itertools.combinations(PARTS, 2):
            assert apart(boxes[one], boxes[other]), (width, one, other)
        beyond = page.page.evaluate(
            "[document.documentElement, ...document.querySelectorAll('#ports, #operate, #lower, #plots, #stage')]"
            ".map(node => [node.id, node.scrollWidth - node.clientWidth])"
        )
        assert [name for name, pixels in beyond if pixels > 0] == [], width
    assert page.said == []


def apart(one: dict[str, float], other: dict[str, float]) -> bool:
    """Whether two boxes have no area in common."""
    beside = any(a["x"] + a["width"] <= b["x"] + 0.5 for a, b in ((one, other), (other, one)))
    return beside or any(a["y"] + a["height"] <= b["y"] + 0.5 for a, b in ((one, other), (other, one)))


def test_names_of_terminals_have_room_however_long_they_are(bench, open_panel):
    """A control with programs names its terminals limit_x1, not p1.0."""
    page = open_panel(bench(controller="bwo900", machine="4030-servo"))
    page["[data-tab=ports]"].click()
    expect(page["#ports .port"].first).to_be_visible()
    for width in (1000, 1500):
        page.page.set_viewport_size({"width": width, "height": 900})
        over = page.page.evaluate(
            "[...document.querySelectorAll('#ports .port')].filter(node => { const c = node.querySelector('code');"
            "return c.scrollWidth > c.clientWidth || c.getBoundingClientRect().right > node.querySelector('.name')"
            ".getBoundingClientRect().left; }).map(node => node.dataset.port)"
        )
        assert over == [], width


def test_a_server_that_goes_and_one_that_takes_its_place(bench, open_panel):
    here = bench()
    page = open_panel(here)
    address = here.panel.address
    page['[data-element="estop"]'].click()
    expect(page['[data-element="estop"]']).to_have_attribute("aria-pressed", "true")
    here.close()
    expect(page["#link"]).to_have_attribute("data-state", "lost")
    expect(page["main"]).to_have_css("filter", "grayscale(1)")
    expect(page["body"]).to_have_js_property("inert", True)
    expect(page["[aria-pressed=true]"]).to_have_count(0)
    bench(address=address)
    expect(page["#link"]).to_have_attribute("data-state", "on")
    expect(page["main"]).to_have_css("filter", "none")
    page['[data-element="estop"]'].click()
    expect(page['[data-element="estop"]']).to_have_attribute("aria-pressed", "true")


def test_the_keys_of_a_control_of_its_own(bench, open_panel):
    """Hand, reference, a program chosen and started, stopped by hand and the override turned down: by its own table."""
    here = bench(controller="bwo900", machine="4030-servo")
    page = open_panel(here)
    keys = page["#keys"]
    expect(keys).to_be_visible()
    assert keys.locator("[data-key]").count() == len(here.twin.keys)
    mode = keys.locator("[data-key=mode]")
    expect(mode.get_by_role("button", name="hand")).to_have_attribute("aria-pressed", "true")
    mode.get_by_role("button", name="single").click()
    expect(mode.get_by_role("button", name="single")).to_have_attribute("aria-pressed", "true")
    override = keys.locator("[data-key=override] input")
    expect(override).to_have_value("100")
    override.fill("80")
    override.press("Enter")
    expect(override).to_have_value("80")
    keys.locator("[data-key=skip]").get_by_role("button", name="on").click()
    expect(keys.locator("[data-key=skip]").get_by_role("button", name="on")).to_have_attribute("aria-pressed", "true")
    override.fill("500")
    override.press("Enter")
    expect(page["#told"]).to_contain_text("allowed: 0 .. 120 %")
    keys.locator("button[data-key=start]").click()
    expect(page['[data-output="message"]']).to_have_attribute("data-on", "1")
    assert here.twin.key_values["override"] == 80.0
    assert page.said == []


def test_an_axis_moves_in_hand_while_its_key_is_held_down(bench, open_panel):
    here = bench(controller="bwo900", machine="4030-servo", speed=1.0, ready=True)
    page = open_panel(here)
    move = page["#keys [data-key=move]"]
    move.get_by_role("button", name="+").hover()
    page.page.mouse.down()
    expect(page['[data-output="moving"]']).to_have_attribute("data-on", "1")
    page.page.mouse.up()
    expect(page['[data-output="moving"]']).to_have_attribute("data-on", "0")
    assert here.twin.counts[0] > 0
    assert page.said == []


def test_a_controller_without_keys_shows_none(bench, open_panel):
    page = open_panel(bench())
    expect(page["#keys"]).to_be_hidden()


def test_a_file_is_opened_run_and_followed_line_by_line(bench, open_panel, tmp_path: Path):
    """Both browsers see it, and so does one that comes later."""
    here = bench(speed=4.0, ready=True)
    part = tmp_path / "part.nc"
    part.write_text("(a slot)\nG21 G90 F1200\nG0 X10\nG1 Y20\nF400 G1 X50\nF1200 G1 Y10\nM2\n")
    page, other = open_panel(here), open_panel(here)
    for each in (page, other):
        each["[data-tab=job]"].click()
        expect(each["#start"]).to_be_disabled()
    page["#file"].set_input_files(part)
    for each in (page, other):
        expect(each["#program li"]).to_have_count(7)
        expect(each["#doing"]).to_contain_text("part.nc (G-code")
        expect(each["#doing"]).to_contain_text("ready")
    page.page.evaluate(
        """() => {
          window.followed = [];
          new MutationObserver(() => {
            const at = document.querySelector("#program [aria-current]");
            if (at) window.followed.push([...at.parentNode.children].indexOf(at) + 1);
          }).observe(document.querySelector("#program"), { subtree: true, attributeFilter: ["aria-current"] });
        }"""
    )
    other["#start"].click()
    expect(page["#doing"]).to_have_attribute("data-state", "done", timeout=1000 * WAIT_S)
    followed = page.page.evaluate("window.followed")
    assert 5 in followed, "a way of six seconds, at four times the speed"
    assert followed == sorted(followed)
    expect(page["[data-axis=x] td:nth-child(3)"]).to_have_text("50.000")
    later = open_panel(here)
    later["[data-tab=job]"].click()
    expect(later["#doing"]).to_contain_text("all lines accepted")
    expect(later["#program li"]).to_have_count(7)
    assert page.said == other.said == []


def test_a_file_is_run_from_a_line_on(bench, open_panel, tmp_path: Path):
    here = bench(ready=True)
    part = tmp_path / "part.nc"
    part.write_text("G21 G90 F1200\nG0 X10\nG1 Y20\nG1 X50\nG1 Y10\nM2\n")
    page, other = open_panel(here), open_panel(here)
    for each in (page, other):
        each["[data-tab=job]"].click()
        expect(each["#from"]).to_be_disabled()
    page["#file"].set_input_files(part)
    page["#to"].fill("3")
    page["#to"].press("Enter")
    expect(other["#to"]).to_have_value("3")
    page["#from"].fill("4")
    page["#from"].press("Enter")
    expect(other["#from"]).to_have_value("4")
    expect(page["#to"]).to_have_value("")
    expect(other["#doing"]).to_contain_text("lines 1 to 3 not made")
    page["#from"].fill("6")
    page["#from"].press("Enter")
    expect(page["#told"]).to_contain_text("nothing moves the tool from line 6 on")
    expect(page["#from"]).to_have_value("4")
    page["#start"].click()
    expect(page["#doing"]).to_contain_text("all lines accepted", timeout=1000 * WAIT_S)
    expect(page["#doing"]).to_contain_text("lines 1 to 3 not made")
    expect(page["[data-axis=y] td:nth-child(3)"]).to_have_text("10.000")
    assert page.said == other.said == []


def test_a_job_is_stopped_and_a_wrong_file_is_told_in_a_line(bench, open_panel, tmp_path: Path):
    here = bench(speed=1.0, ready=True)
    good, bad = tmp_path / "long.txt", tmp_path / "bad.txt"
    good.write_text("@0A64000,2000,0,30,0,30,0,30\n")
    bad.write_text("@0P <999>\n")
    page = open_panel(here)
    page["[data-tab=job]"].click()
    page["#file"].set_input_files(good)
    page["#start"].click()
    expect(page['[data-output="moving"]']).to_have_attribute("data-on", "1")
    page["#halt"].click()
    expect(page["#doing"]).to_contain_text("stopped by hand")
    expect(page['[data-output="moving"]']).to_have_attribute("data-on", "0")
    page["#file"].set_input_files(bad)
    expect(page["#told"]).to_contain_text("bad.txt: line 1: <999> is neither a byte")
    expect(page["#doing"]).to_contain_text("long.txt")
    assert page.said == []


CUT = """
[...document.querySelectorAll("button, span, b, label, td, th, h2, output, summary, code, p")]
  .filter(node => node.offsetParent && node.clientWidth && node.scrollWidth > node.clientWidth + 1)
  .filter(node => getComputedStyle(node).overflow !== "visible").map(node => node.textContent)
"""
"""Labels that are not to be read whole."""


def test_a_desk_for_hands_keys_and_readers(bench, chromium: Browser) -> None:
    """Home, jog by button and key, in steps and held, zero, a place, stop; then what axe and a ruler say of it."""
    here = bench(speed=5.0)
    context = chromium.new_context(viewport={"width": 1024, "height": 768}, bypass_csp=True)  # for axe's script
    context.set_default_timeout(WAIT_S * 1000)
    context.add_init_script("HTMLCanvasElement.prototype.getContext = function(get) { return function(kind, ...more) {"
                            "return /webgl/.test(kind) ? null : get.call(this, kind, ...more) } }"
                            "(HTMLCanvasElement.prototype.getContext)")  # fmt: skip
    page = context.new_page()
    page.goto(here.panel.url)
    work = {axis: page.locator(f"[data-work={axis}]") for axis in "xyz"}
    rest = page.locator("#doings")
    page.locator("#home").click()
    expect(rest).to_contain_text("home")
    expect(rest).to_have_text("at rest")
    for _ in range(5):
        page.locator("#pad [data-axis=x][data-way='1']").click()
    expect(work["x"]).to_have_text("5.000")
    page.locator("[data-step='10']").click()
    page.locator("#bykeys").click()
    page.keyboard.press("ArrowUp")
    page.keyboard.press("PageDown")
    expect(work["z"]).to_have_text("-10.000")
    expect(work["y"]).to_have_text("10.000")
    page.locator("#jogspeed").fill("20")
    page.keyboard.press("ArrowUp")  # of the field: it is not a jog
    page.locator("#zeroall").click()
    expect(work["y"]).to_have_text("0.000")
    page.locator("[data-step=null]").click()
    page.keyboard.down("ArrowRight")
    expect(work["x"]).not_to_have_text("0.000")
    page.keyboard.up("ArrowRight")
    expect(rest).to_have_text("at rest")
    page.locator("#jogspeed").fill("2")  # it is under way for ten seconds, also where nobody looks at once
    page.locator("[data-go=x]").fill("100")
    page.locator("[data-go=x]").press("Enter")
    expect(rest).to_contain_text("to x 100")
    page.keyboard.press("Escape")
    expect(rest).to_have_text("at rest")
    assert float(work["x"].inner_text()) < 100.0
    expect(page.locator("#override")).to_have_text("no feed override on this controller")
    expect(page.locator("#flat")).to_contain_text("no WebGL")
    script = (files("axe_playwright_python") / "axe.min.js").read_text(encoding="utf-8")
    for width, scheme in ((1024, "light"), (390, "dark")):
        page.set_viewport_size({"width": width, "height": 844})
        page.emulate_media(color_scheme=scheme)
        for tab in ("desk", "job", "ports", "faults"):
            page.locator(f"[data-tab={tab}]").click()
            assert page.evaluate(CUT) == [], (width, tab)
            assert page.evaluate("document.documentElement.scrollWidth") <= width, tab
        page.evaluate("for (const tab of document.querySelectorAll('.tab')) tab.hidden = false")
        found = page.evaluate(f"{script}; axe.run({{resultTypes: ['violations']}})")["violations"]
        assert [one["id"] for one in found if one["impact"] in ("serious", "critical")] == [], (width, scheme)
        page.locator("[data-tab=desk]").click()
    context.close()
