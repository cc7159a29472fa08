"""The numbers of the page, in laboratory units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import floor, log10
from typing import TypeAlias

from tympan.base.units import BENCH, segment_words, unit_of
from tympan.explore.session import Blocked, FollowedCurve, Scene
from tympan.fem.results.limit_states import LIMIT_STATES
from tympan.reports.look import segment_colours
from tympan.reports.template import digits
from tympan.studies.alpha import AlphaResult
from tympan.studies.case import Band, Limit

#: Results that are shown, with their names.
SHOWN = {
    "deflection_m": "deflection", "reading_m": "sensor reads", "reaction_N": "force of the film",
    "tilt_rad": "tilt of the plate", "capacitance_F": "capacitance",
    "max_true_stress_Pa": "largest stress", "max_stretch": "largest stretch",
    "max_field_V_per_m": "largest field", "breakdown_margin": "margin to breakdown",
    "slack_area_m2": "film without tension"}

_DIGITS = 5
#: Certain digits on a mesh for sliding numbers: of motions, forces, capacitance; of the film's
#: largest values.
_GUESSED = {"deflection_m": 4, "reading_m": 4, "reaction_N": 4, "capacitance_F": 4}
_GUESSED_MOST = 3

#: Number of certain digits below which the error of a number is written beside it.
_FEW = 3

#: Half of the last of four digits, relative: a smaller error of a limit is not visible.
_SEEN = 5e-5
#: Relative error of a limit whose text includes it.
_LARGE = 5e-3

#: A row of numbers as the page takes it.
Row: TypeAlias = dict[str, str | bool]


def result_rows(scene: Scene, bands: Mapping[str, Band] | None = None) -> list[Row]:
    """List numbers of an equilibrium; in brackets 5 and 95 % of films that scatter about it."""
    rows, bands = [], bands or {}
    for key, words in SHOWN.items():
        unit, factor = BENCH.get(unit_of(key) or "", ("", 1.0))
        value = getattr(scene.result, key)
        if value is not None and not (key == "reading_m" and value == scene.result.deflection_m):
            sure = _GUESSED.get(key, _GUESSED_MOST) if scene.guessed else _DIGITS
            text = f"{digits(factor * value, sure)} {unit}"
            rows.append(_row(key, words, text + _spread(bands.get(key), factor)))
    return [*rows, *_segments(scene)]


def _segments(scene: Scene) -> Iterator[Row]:
    """List voltage and capacitance of each segment, with its colour in the picture."""
    segments = scene.result.segments
    (kilo, per_kilo), (unit, factor) = BENCH["V"], BENCH["F"]
    for each, colour in zip(segments, segment_colours(len(segments)), strict=True):
        sure = _GUESSED["capacitance_F"] if scene.guessed else _DIGITS
        text = (f"{digits(per_kilo * each.voltage_V)} {kilo}, "
                f"{digits(factor * each.capacitance_F, sure)} {unit}")
        yield _row(f"segment-{each.name}", f"segment {each.name}", text) | {"colour": colour}


def _spread(band: Band | None, factor: float) -> str:
    """Write the edges of a band in brackets; "" without a band."""
    if band is None:
        return ""
    return f" ({digits(factor * band.low, _FEW)} to {digits(factor * band.high, _FEW)})"


def blocked_rows(blocked: Blocked, stale: bool = False) -> list[Row]:
    """List the blocked force of a plate; ``stale``: it belongs to another view."""
    if blocked.force is None:
        return []
    unit, factor = BENCH["N"]
    text = _within(factor * blocked.force, factor * blocked.off)
    return [_row("blocked", "blocked force where it rests at 0 kV", f"{text} {unit}", stale)]


def curve_rows(curve: FollowedCurve, deflection: float, stale: bool = False,
               band: Band | None = None) -> list[Row]:
    """List the stroke to a deflection [m] of a curve, and its first limit.

    ``stale``: they belong to another film. ``band`` is that of the stroke.
    """
    line = curve.line
    rows = []
    if len(line.voltage) and line.voltage[0] == 0:
        stroke = _within(1e3 * deflection - float(line.deflection[0]),
                         1e3 * (curve.off.deflection if curve.off else 0.0))
        text = "…" if stale else f"{stroke} mm{_spread(band, 1e3)}"
        rows.append(_row("stroke", "stroke from 0 kV", text, stale))
    first = line.limits.limit
    text = line.end if first is None else first.state.at(_voltage(first, curve))
    return [*rows, _row("first", "first limit", text, stale)]


def limit_rows(curve: FollowedCurve) -> list[Row]:
    """List limits, residuals of readings, and α of the circles."""
    return [*_limits(curve), *_weights(curve.circles)]


def loads_of(scene: Scene) -> str:
    """Write voltage and load of the numbers in words."""
    view = scene.view
    return f"at {view.voltage / 1e3:.6g} kV under {view.mass * 1e3:.6g} g"


def _limits(curve: FollowedCurve) -> Iterator[Row]:
    limits = curve.curve.curves[0].limits
    for limit in limits.told:
        first = " (the limit)" if limit == limits.limit else ""
        yield _row(limit.kind, limit.state.label, f"{_voltage(limit, curve)}"
                   f"{segment_words(limit.segment)}{first}")
    unknown = curve.off is not None and not curve.off.whole
    for kind, state in LIMIT_STATES.items():
        if limits.by_kind.get(kind) is None and state.signs:
            yield _row(kind, state.label, "…" if unknown else "not reached", unknown)
    if curve.readings is not None:
        yield _row("rms", "rms of measured − simulated",
                   f"{digits(1e6 * curve.readings.rms)} µm")


def _weights(circles: AlphaResult | str | None) -> Iterator[Row]:
    if circles is None:
        return
    if isinstance(circles, str):
        yield _row("alpha", "α of circles", circles)
        return
    weights = circles.by_basis["membrane"].alpha
    for number, (radius, weight) in enumerate(zip(circles.circles, weights, strict=True)):
        yield _row(f"alpha-{number + 1}", f"α{'₁₂₃₄₅₆₇₈₉'[number % 9]}, circle of "
                                          f"{digits(1e3 * radius)} mm", digits(weight))


def _within(value: float, off: float) -> str:
    """Write a number with its certain digits; with its error if these are few."""
    if not off > 0 or not value:
        return digits(value, _DIGITS)
    sure = floor(log10(abs(value))) - floor(log10(2 * off))
    text = digits(value, min(max(sure, _FEW), _DIGITS))
    return text if sure >= _FEW else f"{text} ± {digits(off, 1)}"


def _voltage(limit: Limit, curve: FollowedCurve) -> str:
    """Write the voltage of a limit; for a reduced film with its error where visible."""
    if curve.off is None or not _SEEN < limit.spread < _LARGE:
        return limit.text
    return f"{limit.text} ± {100 * limit.spread:.1g} %"


def _row(key: str, name: str, text: str, stale: bool = False) -> Row:
    return {"key": key, "name": name, "text": text.strip(), "stale": stale}
