"""Curves of a session page beside the samples: what is drawn in each pixel is what was recorded in its time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Page, expect

from isel_twin import Twin
from isel_twin.recordings.reading import Recorded, read
from isel_twin.recordings.recording import FileRecording
from isel_twin.report import playback

pytestmark = [
    pytest.mark.usefixtures("chromium"),
    pytest.mark.long(seconds=12),
]

PAUSE_S = 87.0
"""Without a move, so without a sample."""
INTERVAL_NS = 1_000_000

DRAWN = """
() => {
  const strokes = [], bars = [], pen = CanvasRenderingContext2D.prototype, plain = {};
  let path = [];
  const heard = {
    beginPath: () => { path = []; },
    moveTo: (_, x, y) => path.push([x, y, true]),
    lineTo: (_, x, y) => path.push([x, y, false]),
    stroke: ({ strokeStyle }) => strokes.push([strokeStyle, path]),
    fillRect: ({ fillStyle }, ...box) => bars.push([fillStyle, box]),
  };
  for (const [name, hear] of Object.entries(heard)) {
    plain[name] = pen[name];
    pen[name] = function (...where) { hear(this, ...where); plain[name].apply(this, where); };
  }
  document.getElementById("all").click();
  Object.assign(pen, plain);
  const dot = document.createElement("canvas").getContext("2d");
  dot.fillStyle = colour("x");
  const of_x = (drawn) => drawn.filter(([ink]) => ink === dot.fillStyle).map(([, where]) => where);
  const right = document.getElementById("traces").clientWidth - 6;
  return { x: of_x(strokes), bars: of_x(bars), left: 150, right, end: session.end };
}
"""
"""Paths and boxes of the ink of X, of the whole session in one window."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """X goes out in four seconds, stands, goes back in short moves."""
    file = tmp_path_factory.mktemp("drawn") / "pause.mcap"
    twin = Twin(plant="kinematic")
    recording = FileRecording(file, twin, INTERVAL_NS)
    for command in ("@07", "@0N7"):
        assert twin.query(command) == "0"
    assert twin.query("@0A8000,2000,0,30,0,30,0,30") == "0"
    twin.run(PAUSE_S)
    for _ in range(8):
        assert twin.query("@0A-800,4000,0,30,0,30,0,30") == "0"
        twin.run(0.3)
    recording.close()
    return read(file)


def with_velocity(recorded: Recorded) -> Recorded:
    """It, with other samples: 60 s of a wave of 60 mm/s with spikes of 100 mm/s, a pause in which the value is held
    with which it broke off, 3 s of single pulses of a millisecond."""
    random = np.random.default_rng(43)
    times_s = np.concatenate([np.arange(60_000), 60_000 + 1e3 * PAUSE_S + np.arange(3_000)]) / 1e3
    velocity = 60.0 * np.sin(times_s) + 5.0 * random.standard_normal(len(times_s))
    velocity[random.integers(0, 60_000, 20)] = 100.0
    velocity[random.integers(0, 60_000, 20)] = -100.0
    velocity[60_000:] = 0.0
    velocity[60_000 + random.integers(0, 3_000, 5)] = 80.0
    samples = np.zeros(len(times_s), dtype=recorded.samples.dtype)
    samples["velocity_mm_s"][:, 0] = np.round(velocity, 2)
    return replace(recorded, sample_times_ns=np.rint(times_s * 1e9).astype(np.int64), sample_bytes=samples.tobytes())


@pytest.fixture
def drawn(empty_page: Page, tmp_path: Path) -> Callable[..., Any]:
    """drawn(recorded, name): what is drawn of one signal."""

    def show(recorded: Recorded, name: str, most_bytes: int | None = None) -> Any:
        page, _ = playback.playback_page(recorded, most_bytes)
        (tmp_path / "page.html").write_text(page)
        empty_page.goto((tmp_path / "page.html").as_uri())
        expect(empty_page.locator("body")).to_have_attribute("data-ready", "true")
        empty_page.locator("#choice summary").click()
        for box in empty_page.locator("#choice label").all():
            box.locator("input").set_checked(box.inner_text() == name)
        return empty_page.evaluate(DRAWN)

    return show


def held(recorded: Recorded) -> tuple[NDArray[Any], NDArray[Any]]:
    """Times and values of the velocity of X; nothing changes until an interval before the next sample."""
    times_s, values = recorded.sample_times_ns / 1e9, recorded.samples["velocity_mm_s"][:, 0].astype(float)
    gap = int(np.argmax(np.diff(times_s)))
    return np.insert(times_s, gap + 1, times_s[gap + 1] - INTERVAL_NS / 1e9), np.insert(values, gap + 1, values[gap])


def of_line(x: NDArray[Any], y: NDArray[Any], edges: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Least and largest y of the line through the points between two edges each."""
    at = np.interp(edges, x, y)
    low, high = np.minimum(at[:-1], at[1:]), np.maximum(at[:-1], at[1:])
    cell = np.searchsorted(edges, x, side="right") - 1
    inside = (cell >= 0) & (cell < len(low))
    np.minimum.at(low, cell[inside], y[inside])
    np.maximum.at(high, cell[inside], y[inside])
    return low, high


@pytest.mark.parametrize("thinned", [False, True])
def test_each_pixel_of_a_curve_holds_its_least_and_largest_sample_and_a_pause_is_level(
    drawn, recorded: Recorded, monkeypatch: pytest.MonkeyPatch, thinned: bool
) -> None:
    """Two pixels beside and one above are near enough, also where the file was made smaller."""
    made, most_bytes = with_velocity(recorded), None
    if thinned:
        most_bytes = len(playback.playback_page(made, None)[0]) * 2 // 3
    told = drawn(made, "velocity", most_bytes)
    path = np.array(max(told["x"], key=len))
    times_s, values = held(made)
    px_y = (path[:, 1].max() - path[:, 1].min()) / (values.max() - values.min())  # pixels a unit
    shown = values.max() - (path[:, 1] - path[:, 1].min()) / px_y
    pixels = np.arange(told["left"], told["right"] + 1)
    edges_s = (pixels - told["left"]) / (told["right"] - told["left"]) * told["end"]
    low, high = of_line(path[:, 0], shown, pixels.astype(float))
    least, most = of_line(times_s, values, edges_s)
    assert not path[1:, 2].any(), "one line"
    for k in range(len(low)):
        near = slice(max(0, k - 2), k + 3)
        assert low[near].min() <= least[k] + 1.0 / px_y, edges_s[k]
        assert high[near].max() >= most[k] - 1.0 / px_y, edges_s[k]
        assert least[near].min() - 1.0 / px_y <= low[k], edges_s[k]
        assert high[k] <= most[near].max() + 1.0 / px_y, edges_s[k]


def test_a_pause_has_no_ink_but_where_the_value_is_held(drawn, empty_page: Page, recorded: Recorded) -> None:
    """Read from the pixels of the canvas, in the middle of the pause."""
    told = drawn(with_velocity(recorded), "velocity")
    rows = empty_page.evaluate(
        """(share) => {
          const canvas = document.getElementById("traces"), x = 150 + share * (canvas.clientWidth - 156);
          const { data } = canvas.getContext("2d").getImageData(Math.round(x * devicePixelRatio), 0, 1, 60);
          const red = (row) => data[row] > 150 && data[row + 1] < 120 && data[row + 3] > 60;
          return [...Array(60).keys()].filter((row) => red(4 * row));
        }""",
        (60.0 + PAUSE_S / 2.0) / told["end"],
    )
    assert 1 <= len(rows) <= 3
    assert max(rows) - min(rows) == len(rows) - 1


def test_rates_of_a_short_move_are_those_of_its_steps(drawn, recorded: Recorded) -> None:
    """Eight moves of a few pixels, each at 4000 Hz, minus, after the long one at 2000 Hz, plus: bars twice as long."""
    bars = np.array([box for box in drawn(recorded, "step x")["bars"] if box[2] == 1.2])
    up, down = bars[bars[:, 0] < bars[:, 0].mean()], bars[bars[:, 0] > bars[:, 0].mean()]
    assert down[:, 3].max() == pytest.approx(2.0 * up[:, 3].max(), rel=0.02)
    assert down[:, 1].min() == pytest.approx((up[:, 1] + up[:, 3]).max())
