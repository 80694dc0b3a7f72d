"""The trade-off of time and margin, as a table and a picture.

margin |  o  o
       |        o   job as it stands
       |     o
       |   *  tuned            o  the front: no other trial is faster and has more margin
       |  o                    .  everything else that lost nothing
       +-----------------> time
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from isel_twin.base.pictures import picture_bytes, plain_text
from isel_twin.many.tuning.judge import Judgement
from isel_twin.many.tuning.result import Tried, front, gain


def rows(tried: Sequence[Tried], before: Judgement, tuned: int | None = None) -> list[tuple[str, str, str, str, str]]:
    """Trial, time, time saved, margin and settings of each of the front, the fastest first; `tuned` is marked."""
    return [
        (
            f"{'*' if each.number == tuned else ''}{each.number}",
            f"{each.judgement.time_s:.3f}",
            f"{100.0 * gain(each.judgement.time_s, before.time_s):.1f} %" if before.good else "",
            f"{100.0 * each.judgement.margin:.1f} %",
            in_words(each.values),
        )
        for each in front(tried)
    ]


def in_words(values: Mapping[str, int]) -> str:
    """Settings on a line: `speed_hz 21000, ...`; for settings of each move only their number."""
    if len(values) > len({name.partition(".")[0] for name in values}):
        return f"{len(values)} of their own"
    return ", ".join(f"{name} {value}" for name, value in values.items())


def draw(
    kind: str, title: str, tried: Sequence[Tried], marks: Mapping[str, Judgement], least: float | None = None
) -> bytes:
    """A picture of a kind that matplotlib knows ("png", "svg"). marks: further points by name. least: the wanted
    margin, drawn as a line.
    """
    from matplotlib.figure import Figure

    best = [each.judgement for each in front(tried)]
    good = [each.judgement for each in tried if each.judgement.good]
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.subplots()
    axes.plot(*_points(good), ".", color="0.7", label="tried, nothing lost")
    axes.plot(*_points(best), "o-", color="tab:blue", drawstyle="steps-post", label="front")
    for number, (name, judgement) in enumerate(marks.items()):
        if judgement.good:
            shape = "*sD^"[number % 4]
            axes.plot(*_points([judgement]), shape, markersize=11, label=f"{name}: {judgement.time_s:.1f} s")
    if least is not None:
        axes.axhline(100.0 * least, color="tab:red", linewidth=0.8, linestyle="--", label="margin asked for")
    axes.set(xlabel="cycle time in s", ylabel="least margin, of torque and of speed, in %", title=plain_text(title))
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend()
    return picture_bytes(figure, kind)


def _points(judgements: Sequence[Judgement]) -> tuple[list[float], list[float]]:
    return [each.time_s for each in judgements], [100.0 * each.margin for each in judgements]
