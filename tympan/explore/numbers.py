"""The numbers of the page, in the units of the bench."""

from __future__ import annotations

from collections.abc import Iterator

from tympan.explore.session import FollowedCurve, Scene
from tympan.fem.results.limit_states import LIMIT_STATES
from tympan.geometry.units import BENCH, unit_of
from tympan.reports.figures.curve import voltage_curves
from tympan.reports.template import digits
from tympan.studies.alpha import AlphaResult

#: What of a result is shown, and what it is called.
SHOWN = {
    "deflection_m": "deflection", "reading_m": "sensor reads", "reaction_N": "force of the film",
    "tilt_rad": "tilt of the plate", "capacitance_F": "capacitance",
    "max_true_stress_Pa": "largest stress", "max_stretch": "largest stretch",
    "max_field_V_per_m": "largest field", "breakdown_margin": "margin to breakdown",
    "slack_area_m2": "film without tension"}

_DIGITS = 5


def result_rows(scene: Scene) -> list[dict[str, str]]:
    """Numbers of an equilibrium."""
    rows = []
    for key, words in SHOWN.items():
        unit, factor = BENCH.get(unit_of(key) or "", ("", 1.0))
        value = getattr(scene.result, key)
        if value is not None and not (key == "reading_m" and value == scene.result.deflection_m):
            rows.append(_row(key, words, f"{digits(factor * value, _DIGITS)} {unit}"))
    return rows


def limit_rows(curve: FollowedCurve, deflection: float | None = None) -> list[dict[str, str]]:
    """Stroke to the deflection shown [mm], limits, what readings leave, and α of the circles."""
    return [*_stroke(curve, deflection), *_limits(curve), *_weights(curve.circles)]


def loads_of(scene: Scene) -> str:
    """Voltage and load of the numbers, in words."""
    view = scene.view
    return f"at {view.voltage / 1e3:.6g} kV under {view.mass * 1e3:.6g} g"


def _stroke(curve: FollowedCurve, deflection: float | None) -> Iterator[dict[str, str]]:
    line, = voltage_curves(curve.curve)
    if deflection is not None and len(line.voltage) and line.voltage[0] == 0:
        yield _row("stroke", "stroke from 0 kV",
                   f"{digits(deflection - float(line.deflection[0]), _DIGITS)} mm")


def _limits(curve: FollowedCurve) -> Iterator[dict[str, str]]:
    limits = curve.curve.curves[0].limits
    for limit in limits.told:
        first = " (the limit)" if limit == limits.limit else ""
        yield _row(limit.kind, limit.state.verb, f"{limit.text}{first}")
    for kind, state in LIMIT_STATES.items():
        if getattr(limits, kind) is None and state.signs:
            yield _row(kind, state.verb, "not reached")
    if curve.readings is not None:
        yield _row("rms", "rms of measured − simulated",
                   f"{digits(1e6 * curve.readings.rms)} µm")


def _weights(circles: AlphaResult | str | None) -> Iterator[dict[str, str]]:
    if circles is None:
        return
    if isinstance(circles, str):
        yield _row("alpha", "α of circles", circles)
        return
    weights = circles.by_basis["membrane"].alpha
    for number, (radius, weight) in enumerate(zip(circles.circles, weights, strict=True)):
        yield _row(f"alpha-{number + 1}", f"α{'₁₂₃₄₅₆₇₈₉'[number % 9]}, circle of "
                                          f"{digits(1e3 * radius)} mm", digits(weight))


def _row(key: str, name: str, text: str) -> dict[str, str]:
    return {"key": key, "name": name, "text": text.strip()}
