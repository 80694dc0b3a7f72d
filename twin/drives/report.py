"""The torque curve of a motor as a table, as bars in a terminal and as a picture.

The table shows the bench's result beside the closed forms, and marks where it was compared with a measurement:

       rpm   pull-out   least    most   predicted   bound   0 ... Nm
       300 *    1.651   1.405   1.945       1.660   1.662   ##########################|
       650      1.355   1.056   1.762       1.371   1.544   #####################   |     * a maker's curve was compared
       850 ~    0.720   0.524   1.480       1.010   1.250   ###########        |          ~ a swing grows
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from json import dumps
from pathlib import Path

from isel_twin.base.pictures import Curve, draw_curves
from isel_twin.drives import bands, curves, stability
from isel_twin.drives.library import MOTORS, SHEETS, figures
from isel_twin.drives.motor import Motor
from isel_twin.drives.stage import Stage

SPEEDS_RPM = (30, 60, 90, *range(150, 1001, 50))  # speeds of the table

# conditions under which a maker's curve was compared: ranges of supply in V and of speed in rev/min
COMPARED = {
    "23HS32-4004S": ((36.0, 48.0), (90.0, 600.0), "36 and 48 V, 4.2 A peak, microstep, digital drive"),
    "17HS19-2004S": ((24.0, 24.0), (25.0, 1500.0), "24 V, 2 A peak, microstep, digital drive"),
    "14HS17-0504S": ((20.0, 20.0), (90.0, 450.0), "20 V, 0.5 A, half step"),
}

BAR = 40  # characters of the longest bar


@dataclass(frozen=True)
class TorquePoint:
    speed_rpm: float
    pull_out_nm: float
    predicted_nm: float
    envelope_nm: float
    least_nm: float
    """Nine motors of ten have more torque than this (bands.py), and less than `most_nm`."""
    most_nm: float
    growth_per_s: float | None
    """Of a small swing under stability.LOAD_SHARE of the torque; below 0: it dies away. None: no steady rotation."""

    @property
    def band(self) -> float | None:
        """How far the farther end of the band is, over the torque; None without torque."""
        away_nm = max(self.most_nm - self.pull_out_nm, self.pull_out_nm - self.least_nm)
        return away_nm / self.pull_out_nm if self.pull_out_nm else None

    @property
    def stable(self) -> bool:
        return self.growth_per_s is not None and self.growth_per_s <= 0.0


def torque_table(motor: Motor, stage: Stage, speeds_rpm: Sequence[float] = SPEEDS_RPM) -> list[TorquePoint]:
    """Pull-out torque from the bench and from both closed forms, and the growth of a swing, for each speed, rising."""
    rotations = bench(motor, stage).rotations(speeds_rpm)
    return [
        _point(motor, stage, rpm, None if rotation is None else rotation.growth_per_s)
        for rpm, rotation in zip(speeds_rpm, rotations, strict=True)
    ]


def _point(motor: Motor, stage: Stage, speed_rpm: float, growth_per_s: float | None) -> TorquePoint:
    """The band is around both the bench and the closed form, which differ where an undamped motor swings; where the
    iron loss leaves no torque, half of it may be there."""
    pull_out_nm = curves.pull_out_torque(motor, stage, speed_rpm)
    predicted_nm = curves.pull_out_prediction(motor, stage, speed_rpm)
    least, most = bands.torque_band(motor, stage, speed_rpm)
    bound_nm = curves.pull_out_envelope(motor, stage, speed_rpm)
    least_nm = least * min(pull_out_nm, predicted_nm)
    most_nm = max(most * max(pull_out_nm, predicted_nm), 0.5 * motor.iron_torque_nm(speed_rpm * math.pi / 30.0))
    return TorquePoint(speed_rpm, pull_out_nm, predicted_nm, bound_nm, least_nm, most_nm, growth_per_s)


def bench(motor: Motor, stage: Stage) -> stability.Bench:
    """With its own inertia once more and stability.LOAD_SHARE of its torque on the shaft."""
    return stability.Bench(motor, stage, stability.LOAD_SHARE * motor.torque_constant_nm_per_a * stage.current_a)


def default_stage(motor: Motor) -> Stage:
    """48 V, the rated current as the peak of the microstep wave (4 A if unknown), 1600 microsteps a revolution."""
    current = 4.0 if math.isinf(motor.rated_current_a) else motor.rated_current_a
    return Stage(supply_v=48.0, current_a=current, microsteps=max(1, 1600 // motor.full_steps_per_rev))


def show_motor(
    name: str,
    stage: Stage | None = None,
    picture: Path | None = None,
    motors: Mapping[str, Motor] = MOTORS,
    *,
    json: bool = False,
) -> None:
    """Print the torque curve of motor `name` on a stage (None: `default_stage`), as a table or as one JSON object, and
    draw it into `picture`. Raises ValueError for an unknown motor, or for a picture without matplotlib.
    """
    if name not in motors:
        raise ValueError(f"unknown motor {name!r}; there are: {', '.join(motors)}")
    motor = motors[name]
    stage = stage or default_stage(motor)
    table = torque_table(motor, stage)
    if json:
        curve = [{**asdict(point), "band": point.band} for point in table]
        data = {"motor": name, "data": figures(motor), "stage": figures(stage), "curve": curve}
        print(dumps(data))
    else:
        print("\n".join(_text(name, motor, stage, table)))
    if picture is not None:
        draw_torque(table, _title(name, stage), picture)


def _stable(motor: Motor, stage: Stage) -> str:
    """How fast it can turn without swinging itself out of step, in a line."""
    on = bench(motor, stage)
    limit = on.limit()
    load = f"under a load of {on.load_nm:.2g} Nm"
    if limit.ends == "unsure":
        return f"no limit of the swing is told {load}: where one begins to grow depends on sub-steps or its size"
    if not limit.swings:
        where = ", where the torque ends" if limit.ends == "torque" else ""
        return f"the supply feeds no swing up to {limit.speed_rpm:.0f} rev/min {load}{where}"
    rule = f"(rule of thumb {stability.rule_rpm(motor, stage):.0f})"
    return (
        f"~ from {limit.speed_rpm:.0f} rev/min on a swing grows {load} {rule}: a kick dies at 0.95 of that speed and "
        "grows at 1.05, whatever the closed forms say"
    )


def _beyond(motor: Motor, stage: Stage) -> list[str]:
    """From which speed on the band is wide, as nobody has compared."""
    rule = stability.rule_rpm(motor, stage)
    lines = [f"beyond {bands.LAST * rule:.0f} rev/min nobody compared: expect less torque than predicted"]
    if stage.microsteps == 1:
        limit = bands.FULL_STEP_LIMIT * rule
        lines.append(
            f"in full step a maker's limits of two motors would be {limit:.0f} rev/min here: least is 0 beyond"
        )
    return lines


def draw_torque(table: Sequence[TorquePoint], title: str, file: Path) -> None:
    """Draw torque, and below it the growth of a swing, into a file (type by suffix: png, svg, pdf). Raises ValueError
    without matplotlib."""
    speeds = [point.speed_rpm for point in table]
    lines = [
        Curve("closed form: bound", speeds, [point.envelope_nm for point in table], "--"),
        Curve("closed form: prediction", speeds, [point.predicted_nm for point in table], ":"),
        Curve("pull-out torque", speeds, [point.pull_out_nm for point in table], "o-"),
        Curve("least and most of nine motors of ten", speeds, [point.least_nm for point in table], "k:"),
        Curve("", speeds, [point.most_nm for point in table], "k:"),
    ]
    if swinging := [point for point in table if not point.stable]:
        at = [point.speed_rpm for point in swinging]
        lines.append(Curve("a swing grows", at, [point.pull_out_nm for point in swinging], "rx"))
    grows = [math.nan if point.growth_per_s is None else point.growth_per_s for point in table]
    below = "growth of a swing, 1/s", Curve("", speeds, grows, "o-")
    draw_curves(file, title, "speed, rev/min", "torque, Nm", lines, below)


def _title(name: str, stage: Stage) -> str:
    steps = {1: "full step", 2: "half step"}.get(stage.microsteps, f"{stage.microsteps} microsteps a full step")
    damped = ", damped" if stage.damping_gain > 0.0 and not stage.stepped else ""
    amps = f"{stage.current_a:g} A peak ({stage.current_rms_a:.3g} A RMS)"
    return f"{name} at {stage.supply_v:g} V, {amps}, {steps}, {stage.kind} stage{damped}"


def _text(name: str, motor: Motor, stage: Stage, table: Sequence[TorquePoint]) -> list[str]:
    """Lines for a terminal: data, the table with bars (# pull-out, | bound), starting rate and resonance."""
    never = (math.inf, -math.inf)
    supplies, speeds, conditions = COMPARED.get(name, (never, never, ""))
    compared = supplies[0] <= stage.supply_v <= supplies[1]
    top = max(point.envelope_nm for point in table) or 1.0
    lines = [
        _title(name, stage),
        f"R {motor.resistance_ohm:g} ohm, L {motor.inductance_h * 1e3:g} mH, Km {motor.torque_constant_nm_per_a:.3f} "
        f"Nm/A, J {motor.rotor_inertia_kgm2:g} kg m^2, detent {motor.detent_torque_nm:.3f} Nm, "
        f"Rm {motor.iron_loss_ohm:.3g} ohm, iron drag largest at {motor.iron_knee_rad_s * 30.0 / math.pi:.0f} rev/min",
        "",
        f"{'rpm':>6}   {'pull-out Nm':>12} {'least':>8} {'most':>8} {'predicted Nm':>12} {'bound Nm':>12}",
    ]
    for point in table:
        bar = list("#" * round(BAR * point.pull_out_nm / top) + " " * (BAR + 1))
        bar[round(BAR * point.envelope_nm / top)] = "|"
        picture = "".join(bar).rstrip()
        mark = "*" if compared and speeds[0] <= point.speed_rpm <= speeds[1] else " " if point.stable else "~"
        band = f"{point.least_nm:8.3f} {point.most_nm:8.3f}"
        forms = f"{point.predicted_nm:12.3f} {point.envelope_nm:12.3f}"
        lines.append(f"{point.speed_rpm:6g} {mark} {point.pull_out_nm:12.3f} {band} {forms}  {picture}")
    rate, resonance = curves.pull_in_rate(motor, stage), curves.resonance_hz(motor, stage)
    slowest, fastest = (share * rate for share in bands.STARTS)
    low, high = (math.sqrt(share) * resonance for share in bands.torque_band(motor, stage, 0.0))
    lines += [
        "",
        f"starts from rest, unloaded: up to {rate:.0f} steps/s of this stage ({slowest:.0f} to {fastest:.0f}; "
        f"{rate / stage.microsteps:.0f} full steps/s), except near its resonance",
        f"resonance, unloaded: {resonance:.0f} Hz ({low:.0f} to {high:.0f})",
        f"* compared with the maker's curve, at {conditions}, {speeds[0]:g} to {speeds[1]:g} rev/min: docs/fidelity.md"
        if conditions
        else "no maker's curve of this motor was compared; the law was on others: see docs/fidelity.md",
        "least, most: where nine motors of ten lie, by what the law missed on motors that it was not fitted on",
        *_beyond(motor, stage),
        _stable(motor, stage),
    ]
    if (km := motor.at_current(stage.vector_a).torque_constant_nm_per_a) < motor.torque_constant_nm_per_a:
        lines.append(f"saturation: Km {km:.3f} Nm/A on this stage (holding torque against back-EMF of the sheet)")
    if sheet := SHEETS.get(name):
        lines.append(f"source: {sheet.source}; its current: {sheet.current}")
    return lines
