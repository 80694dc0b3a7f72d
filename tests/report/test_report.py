"""The report about a job: a page of its own that says what happened, whatever the job and its replies are."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.base.axes import CARRIAGES
from isel_twin.jobs.checks.job import Inspection
from isel_twin.jobs.checks.rules import Bounds
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.sending import play
from isel_twin.jobs.verdict import judge
from isel_twin.language import create_language
from isel_twin.recordings.recorder import Recorder, sample_dtype
from isel_twin.report.columns import COLUMNS, columns
from isel_twin.report.report import write_report
from tests.panel.chromium import ARGUMENTS, MISSING, find_browser

MS = 1_000_000
JOB = """@07
@0R7
@0M8000,5000,4000,5000,0,5000,0,30
@0B2,1
@0?"&amp;'</td
@0M0,5000,0,5000,0,5000,0,30 => 7
"""
VOID = {"meta", "br", "hr", "img", "input", "link"}


def report(path: Path, job: str = JOB, title: str = "a job", bounds: Bounds | None = None, **call: Any) -> str:
    """Play a job with the kinematic plant and write its report."""
    twin = Twin(plant="kinematic", **call)
    lines = parse_job(job, create_language("imc-s8"), "imc-s8")
    with Recorder(twin, 10 * MS) as recorder:
        inspection = Inspection(twin, bounds)
        for result in play(twin, lines, 100.0):
            inspection.take(result)
        verdict = judge(twin, inspection.results)
        found = inspection.report("job", verdict)
        write_report(path, title, twin, recorder, inspection.results, verdict.summary(), found, inspection.bounds)
    return path.read_text("utf-8") if path.suffix == ".html" else ""


class Page(HTMLParser):
    """Reads a page strictly: every element is closed where it has to be, ids are unique, links inside have an end."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len({name for name, _ in attrs}) == len(attrs)
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] not in (["script"], ["style"]):
            self.text += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> str:
    return report(tmp_path_factory.mktemp("report") / "r.html", title="<b>job & \"co\" 'x'</b> \x00\x07\udcff")


def test_the_page_is_whole_and_its_links_lead_somewhere(text: str) -> None:
    page = Page(text)
    names = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(set(names)) == len(names)
    for tag, attributes in page.tags:
        for key in ("href", "src"):
            if key in attributes:
                target = attributes[key]
                assert target is not None
                assert target.startswith("#"), f"{tag} loads {target}"
                assert target[1:] in names
        for key in ("aria-labelledby",):
            assert set((attributes.get(key) or "").split()) <= set(names)
        assert not any(name.startswith("on") or name == "style" for name in attributes), "the policy forbids it"
    assert {"summary", "findings", "path", "plots", "commands"} <= set(names)


def test_it_asks_for_nothing(text: str) -> None:
    page = Page(text)
    policy = next(each["content"] for each in page.all("meta") if each.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None
    assert policy.startswith("default-src 'none'")
    assert "unsafe" not in policy
    assert "://" not in text
    assert not re.search(r"url\(|@import|\bfetch\b|XMLHttp|=['\"]?//", text)


def test_a_screen_reader_has_headings_tables_and_words_for_drawings(text: str) -> None:
    page = Page(text)
    assert page.all("html")[0]["lang"] == "en"
    assert len(page.all("h1")) == 1
    assert len(page.all("h2")) >= 5
    assert len(page.all("caption")) == len(page.all("table"))
    assert all(each.get("scope") in ("row", "col") for each in page.all("th"))
    outer = [each for each in page.all("svg") if "viewbox" in each and "x" not in each]
    assert len(outer) >= 4
    assert all(each.get("role") == "img" and ("aria-label" in each or "aria-labelledby" in each) for each in outer)
    assert all(each.get("aria-label") for each in page.all("button"))


def test_what_comes_from_outside_is_text(text: str) -> None:
    page = Page(text)
    assert "<b>job & \"co\" 'x'</b>" in page.text
    assert "@0?\"&amp;'</td" in page.text
    assert not page.all("b")
    assert not re.search("[\x00-\x08\x0b\x0c\x0e-\x1f]", text)


def test_verdict_limits_findings_and_commands_are_there(text: str) -> None:
    page = Page(text)
    assert "FAILED" in page.text
    assert "6 commands" in page.text
    assert page.text.count("@0M8000,5000,4000,5000,0,5000,0,30") >= 1
    findings = [each for each in page.all("li") if "finding" in (each.get("class") or "")]
    assert len(findings) == 2, "a command that is none, and a reply that is not the expected one"
    assert sum(each.get("href") == "#line-5" for each in page.all("a")) == 1
    assert len(page.all("use")) == 2 * len(findings), "each has its picture"
    assert "spindle" in page.text
    assert "limit_x1" in page.text


def test_findings_are_marked_where_they_are(text: str) -> None:
    """X to the right and Y upwards, in one scale."""
    found = re.findall(
        r"Place of finding \d in the path, X ([\d.]+) mm, Y ([\d.]+) mm.*?<circle cx='([\d.]+)' cy='([\d.]+)'", text
    )
    (x0, y0, u0, v0), (x1, y1, u1, v1) = (map(float, one) for one in found)
    assert (x0, y0, x1, y1) == pytest.approx((25.0, 12.5, 0.0, 0.0), abs=0.1)
    assert u0 - u1 == pytest.approx(2.0 * (v1 - v0), abs=0.3)
    assert u0 - u1 > 10.0


def test_a_state_is_as_wide_as_it_lasts(text: str) -> None:
    spans = re.findall(
        r"<rect [^>]*x='([\d.]+)' [^>]*width='([\d.]+)'[^>]*><title>[^<]* from ([\d.]+) to ([\d.]+) s<", text
    )
    told = [tuple(map(float, span)) for span in spans]
    left, _, begin, _ = min(told, key=lambda span: span[2])
    right, _, end, _ = max(told, key=lambda span: span[2])
    px_per_s = (right - left) / (end - begin)
    for x, width, first_s, last_s in told:
        assert x == pytest.approx(left + px_per_s * (first_s - begin), abs=0.5)
        assert width == pytest.approx(max(px_per_s * (last_s - first_s), 0.6), abs=0.5)


def test_the_same_job_gives_the_same_page(tmp_path: Path) -> None:
    first, second = (report(tmp_path / f"{name}.html") for name in "ab")
    assert first == second


def test_a_limit_is_told_and_judged(tmp_path: Path) -> None:
    text = report(tmp_path / "r.html", "@07\n@0R7\n", bounds=Bounds(cycle_s=1.0, may_strike=("limit_x1",)))
    page = Page(text)
    assert "at most 1 s" in page.text
    assert "may be struck: limit_x1" in page.text
    assert "FAILED" in page.text
    assert "OK" in Page(report(tmp_path / "s.html", "@07\n@0R7\n")).text


def test_a_reference_run_is_no_jump(tmp_path: Path) -> None:
    """From power-on to the end of the reference run and back: the counters jump to 0, the machine never does."""
    twin = Twin(plant="kinematic")
    with Recorder(twin, 10 * MS) as recorder:
        for line in (b"@07\r", b"@0R7\r", b"@0A1600,5000,0,30,0,30,0,30\r"):
            twin.write(line)
            twin.run_until(twin.time_ns + 10**12, lambda: twin.idle)
        seen = columns(recorder, twin.step_mm, twin.time_ns)
        steps_mm = [np.abs(np.diff(samples["position_mm"], axis=0)).max(initial=0.0) for samples in recorder.samples()]
    fastest_mm_s = 5000 * twin.step_mm[0]
    assert max(steps_mm) > 10.0, "the zero moves by the way of the reference run"
    assert np.nanmax(seen.speed_mm_s[1]) < 1.2 * fastest_mm_s
    assert np.abs(np.diff(seen.way.position_mm, axis=0)).max() < 1.0
    assert seen.way.position_mm[-1] == pytest.approx(twin.position_mm, abs=0.02)
    assert len(set(seen.piece.tolist())) >= 2


class Long:
    """A recorder with an hour of samples, 10 ms apart: a carriage that goes to and fro, a peak of a single sample."""

    axes = 4
    counters_set_ns: tuple[int, ...] = ()

    def samples(self) -> Any:
        for first in range(0, 360_000, 60_000):
            number = np.arange(first, first + 60_000)
            piece = np.zeros(len(number), dtype=sample_dtype(self.axes))
            piece["time_ns"] = number * 10 * MS
            piece["position_mm"][:, 0] = np.abs(number % 2000 - 1000) / 10.0
            piece["position_mm"][:, 1] = np.where(number == 200_001, 5.0, 0.0)
            yield piece


def test_an_hour_is_as_small_as_a_screen_and_keeps_its_peaks() -> None:
    seen = columns(Long(), np.full(len(CARRIAGES), 0.01), 3600 * 1000 * MS)
    assert len(seen.time_ns) <= COLUMNS
    assert np.nanmax(seen.error_mm[1][:, 1]) == 5.0
    assert len(seen.way.time_ns) <= 16_000
    assert seen.way.deviation_mm.max() == 100.0
    assert seen.speed_mm_s[1].max() == pytest.approx(np.hypot(0.1, 5.0) / 0.01)


def test_a_name_that_ends_in_png_makes_a_picture(tmp_path: Path) -> None:
    from matplotlib import image

    report(tmp_path / "r.png")
    pixels = image.imread(tmp_path / "r.png")
    assert pixels.shape[0] > 800
    assert pixels.shape[1] == 1300
    assert pixels[..., :3].std() > 0.05


def test_a_browser_opens_it_without_a_request_or_an_error_and_zooms(tmp_path: Path, text: str) -> None:
    from playwright.sync_api import sync_playwright

    if find_browser() is None:
        pytest.skip(MISSING)
    (tmp_path / "r.html").write_text(text, encoding="utf-8")
    said, asked = [], []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=find_browser(), args=list(ARGUMENTS))
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto((tmp_path / "r.html").as_uri())
        assert asked == [(tmp_path / "r.html").as_uri()]
        whole = page.get_attribute("#zoom", "transform")
        page.click("button[data-act='+']")
        closer = page.get_attribute("#zoom", "transform")
        assert closer is not None
        assert closer.startswith("matrix(2 ")
        page.focus("#times")
        page.keyboard.press("0")
        assert page.get_attribute("#zoom", "transform") == whole
        page.click("button[data-from] >> nth=0")
        assert "s to" in page.inner_text("#told")
        sideways = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
        assert sideways <= 0
        browser.close()
    assert said == []
    assert len(asked) == 1


def test_what_has_nothing_to_tell_says_none() -> None:
    """A drive that has not switched itself off has no reason for it."""
    from isel_twin.report.report import _facts

    assert ">none, none</td>" in _facts({"switched_off": ["", ""]})
