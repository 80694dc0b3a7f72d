"""Two sessions laid over each other as a page: the verdict, what differs, and both time lines, without a script.

A  |##|   |########|  |####|        each command from its last byte to the last one of its reply; what differs is
B  |##|   |########|  |######|      marked, and linked to its row
"""

from __future__ import annotations

from collections.abc import Sequence

from isel_twin.base.units import SECOND_NS
from isel_twin.recordings.compare import Exchange
from isel_twin.recordings.judging import Comparison
from isel_twin.report.page import whole_page
from isel_twin.report.svg import WIDTH, escape, nice, tenths

LANE, LEFT, AXIS = 26, 20, 22  # px: height of a time line, width of its name, height of the axis
LEAST = 1.5  # px, width of the shortest command
ROWS = 400  # most rows of the table


def sessions_page(title: str, verdict: str, lines: Sequence[str], names: tuple[str, str], found: Comparison) -> str:
    """lines: what is said below the verdict. names: of the recordings A and B."""
    good = found.same
    body = [
        f"<header><h1>{escape(title)}</h1>",
        f"<p class='verdict {'good' if good else 'bad'}'>{escape(verdict)}</p>",
        f"<p>A: {escape(names[0])}. B: {escape(names[1])}.</p></header><main>",
        "<section><ul>",
        *(f"<li>{escape(line)}</li>" for line in lines),
        "</ul></section>",
        "<section><h2>Time lines</h2><figure>",
        _time_lines(found),
        "<figcaption>Each command from its last byte to the last one of its reply; red: differs. Both begin with "
        "their first command.</figcaption></figure></section>",
        _table(found),
        "</main>",
    ]
    return whole_page(title, body)


def _time_lines(found: Comparison) -> str:
    lanes = [[(pair.a, pair.number) for pair in found.pairs], [(pair.b, pair.number) for pair in found.pairs]]
    lanes[0] += [(one, 0) for one in found.only_a]
    lanes[1] += [(one, 0) for one in found.only_b]
    begins = [min((one.sent_ns for one, _ in lane), default=0) for lane in lanes]
    longest = max(
        ((one.replied_ns or one.sent_ns) - begin for lane, begin in zip(lanes, begins, strict=True) for one, _ in lane),
        default=1,
    )
    _, end_s, step_s = nice(0.0, longest / SECOND_NS)
    scale = (WIDTH - LEFT) / max(end_s, 1e-9) / SECOND_NS
    height = 2 * LANE + AXIS
    parts = [f"<svg viewBox='0 0 {WIDTH} {height}' width='{WIDTH}' height='{height}' role='img'>"]
    for row, (lane, begin) in enumerate(zip(lanes, begins, strict=True)):
        top = row * LANE + 3
        parts.append(f"<text x='2' y='{top + 15}'>{'AB'[row]}</text>")
        parts += [_bar(one, number, begin, scale, top, number == 0 or number in found.by_pair) for one, number in lane]
    for tick in range(round(end_s / step_s) + 1):
        x = LEFT + tick * step_s * SECOND_NS * scale
        parts.append(f"<text x='{tenths(x)}' y='{height - 6}' text-anchor='middle'>{tick * step_s:g} s</text>")
    return "".join((*parts, "</svg>"))


def _bar(one: Exchange, number: int, begin_ns: int, scale: float, top: int, differs: bool) -> str:
    x = LEFT + (one.sent_ns - begin_ns) * scale
    wide = max(LEAST, (one.duration_ns or 0) * scale)
    shape = f"<rect class='{'fault' if differs else 'axis1'}' x='{tenths(x)}' y='{top}' width='{tenths(wide)}' "
    title = f"<title>{number or 'only here'}: {escape(one.text)}</title>"
    drawn = f"{shape}height='{LANE - 6}' fill='{'#c22' if differs else '#369'}'>{title}</rect>"
    return f"<a href='#command-{number}'>{drawn}</a>" if differs and number else drawn


def _table(found: Comparison) -> str:
    rows = [
        f"<tr id='command-{one.pair.number}'><td>{one.pair.number}</td><td>{one.pair.a.sent_ns / SECOND_NS:.3f}</td>"
        f"<td><code>{escape(one.pair.a.text)}</code></td><td>{one.kind}</td><td>{escape(one.text)}</td></tr>"
        for one in found.weighed[:ROWS]
    ]
    rows += [
        f"<tr><td></td><td>{one.sent_ns / SECOND_NS:.3f}</td><td><code>{escape(one.text)}</code></td>"
        f"<td>only in {name}</td><td></td></tr>"
        for name, side in (("A", found.only_a), ("B", found.only_b))
        for one in side[:ROWS]
    ]
    if not rows:
        return ""
    head = "<tr><th>no</th><th>A / s</th><th>command</th><th>what</th><th>how</th></tr>"
    return f"<section><h2>What differs, the weightiest first</h2><table>{head}{''.join(rows)}</table></section>"
