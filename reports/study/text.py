"""The results in plain sentences, made from the numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np

from tympan.reports.scales import digits, percent
from tympan.reports.study.load import Curve, Run, Stored
from tympan.reports.template import sentence_list
from tympan.studies.alpha import AlphaResult


def study_summary(run: Run) -> str:
    """One paragraph: deflections, stress at the plate, what the voltage does, and what α says."""
    stress = stress_at_plate(run.specimens, run.stress_range[0])
    said = (deflections(run), stress, tension(run), breakdown(run), strokes(run),
            weights(run.alphas))
    return tied(" ".join(filter(None, said)))


def tied(text: str) -> str:
    r"""The text with its numbers and units kept on one line.

    Examples
    --------
    >>> tied("2.18 mm (a 2 by 3 thing)")
    '2.18\xa0mm (a 2 by 3 thing)'
    """
    return re.sub(r"(?<=\d) (?=(?:mm|kPa|kV|g)\b)", "\N{NO-BREAK SPACE}", text)


def deflections(run: Run) -> str:
    """How far each plate sinks, and how much farther than that of the reference."""
    first = reference(run.specimens)
    each = sentence_list([f"{digits(item.deflection)} mm ({item.name})" for item in run.specimens])
    sentence = f"Under {run.mass:g} g at {run.voltage:g} kV the plate sinks {each}."
    others = [item for item in run.specimens if item is not first]
    if not others or not first.deflection:
        return sentence
    ratios = sentence_list([f"{item.name} {more(item.deflection / first.deflection)}" for item in others])
    return f"{sentence} At this equal load, compared with {first.name}, {ratios}."


def reference(specimens: Sequence[Stored]) -> Stored:
    """What the others are compared with: the first round one, or else the first."""
    return next((item for item in specimens if item.round), specimens[0])


def more(ratio: float) -> str:
    r"""A ratio as a difference in words.

    Examples
    --------
    >>> more(1.0756), more(0.88), more(1.0)
    ('sinks 7.6\u202f% more', 'sinks 12\u202f% less', 'sinks as much')
    """
    if abs(ratio - 1) < 5e-4:
        return "sinks as much"
    return f"sinks {percent(abs(ratio - 1))} {'more' if ratio > 1 else 'less'}"


def tension(run: Run) -> str:
    """Which films of the picture have lost tension, and over how much of their area."""
    lost = [f"{percent(item.result.slack_share)} of {item.name}" for item in run.specimens
            if item.loose]
    return f"Tension is lost in {sentence_list(lost)}: the film wrinkles there (hatched)." if lost else ""


def breakdown(run: Run) -> str:
    """How far each film of the picture is from electrical breakdown, where a strength is known."""
    known = [(item, item.result.breakdown_margin) for item in run.specimens
             if item.result.breakdown_margin is not None]
    if not known:
        return ""
    each = sentence_list([f"{digits(margin)} ({item.name})" for item, margin in known])
    return f"The film's electric strength is at least {each} times its field."


def stress_at_plate(specimens: Sequence[Stored], least: float) -> str:
    """On which axis the stress at the plate is larger, and by how much; ``least`` stress of all films [kPa]."""
    parts, where = [], "The largest principal true stress at the plate"
    for axis in dict.fromkeys(_larger(item) for item in specimens if not item.alike):
        chosen = [item for item in specimens if not item.alike and _larger(item) == axis]
        parts.append(f"{where} is higher on the {axis} axis {sentence_list([_difference(item) for item in chosen])}. "
                     f"{_above(chosen, least)}".strip())
    alike = [f"{item.name} ({digits(item.long.at_plate, 4)} kPa)" for item in specimens
             if item.alike]
    if alike:
        parts.append(f"{'It' if parts else where} is the same on both axes in {sentence_list(alike)}.")
    return " ".join(parts)


def _larger(specimen: Stored) -> str:
    return specimen.axes[0] if specimen.short.at_plate > specimen.long.at_plate else specimen.axes[1]


def _difference(specimen: Stored) -> str:
    high, low = _ends(specimen)
    return f"by {digits(high - low, 2)} kPa in {specimen.name} ({digits(high, 4)} against {digits(low, 4)} kPa)"


def _above(specimens: Sequence[Stored], least: float) -> str:
    """The difference as a share of what the load adds, where the film is stressed without it."""
    ends = [_ends(item) for item in specimens]
    if least < max(high for high, _ in ends) / 2 or min(low for _, low in ends) <= least:
        return ""
    shares = sentence_list([percent((high - least) / (low - least) - 1) for high, low in ends])
    return (f"The prestretch alone makes most of this stress; counted from the smallest in these films, "
            f"{digits(least, 4)} kPa, the difference is {shares}.")


def _ends(specimen: Stored) -> tuple[float, float]:
    """The larger and the smaller stress at the plate on the two axes [kPa]."""
    pair = specimen.short.at_plate, specimen.long.at_plate
    return max(pair), min(pair)


def strokes(run: Run) -> str:
    """How far the voltage moves each plate under the picture's mass, or the lightest of the curves."""
    there = sorted({curve.mass for item in run.specimens for curve in item.curves})
    if not there:
        return ""
    mass = run.mass if run.mass in there else there[0]
    pairs = [(item.name, curve) for item in run.specimens for curve in item.curves
             if curve.mass == mass]
    low = min(float(curve.voltage[0]) for _, curve in pairs)
    high = max(float(curve.voltage[-1]) for _, curve in pairs)
    return (f"Raising the voltage from {low:g} to {high:g} kV under {mass:g} g lowers the plate by up to another "
            f"{sentence_list([stroke(name, curve) for name, curve in pairs])}.")


def stroke(name: str, curve: Curve) -> str:
    """Largest travel of one plate from where it is at the first voltage with an equilibrium, before any pull-in."""
    if not curve.found.any():
        return f"unknown distance ({name}: no equilibrium)"
    above = curve.pull_in[1] if curve.pull_in else np.inf
    reached = curve.deflection[curve.found & (curve.voltage < above)]
    if not len(reached):
        return f"unknown distance ({name}: it pulls in at once)"
    end = f", before it pulls in below {above:g} kV" if curve.pull_in else ""
    return f"{digits(float(reached.max() - reached[0]))} mm ({name}{end})"


def weights(alphas: Sequence[AlphaResult]) -> str:
    """Which mixture of circles each elongated shape behaves as."""
    found = [item for item in alphas if len(item.circles) > 1]
    if not found:
        return ""
    worst = percent(max(item.by_basis["membrane"].fit_error for item in found))
    return (f"As a mixture of circular membranes, {', '.join(map(_mixture, found))}; "
            f"the force is met within {worst.removeprefix('< ')}.")


def _mixture(item: AlphaResult) -> str:
    parts = zip(item.by_basis["membrane"].alpha, item.circles, strict=True)
    mixed = " + ".join(f"{weight:.2f} of radius {radius * 1e3:g} mm" for weight, radius in parts)
    return f"{item.specimen} is {mixed}"


def study_warnings(run: Run) -> list[str]:
    """Every warning stored, and every point of the curves without a result, each with its specimen."""
    return [*(f"{item.name}: {text}" for item in run.specimens for text in item.result.warnings),
            *(text for item in run.specimens for text in _gaps(item)),
            *(f"{item.specimen}, α: {text}" for item in run.alphas for text in item.warnings
              if not text.startswith("the semi-axes are equal"))]


def _gaps(specimen: Stored) -> Iterator[str]:
    for curve in specimen.curves:
        lost = [voltage for voltage, status in zip(curve.voltage, curve.status, strict=True)
                if status not in ("equilibrium", "no_equilibrium")]
        if lost:
            yield (f"{specimen.name}: the curve for {curve.mass:g} g has no result at "
                   f"{', '.join(f'{voltage:g}' for voltage in lost)} kV (not converged)")
        slack = curve.voltage[curve.loose]
        if len(slack):
            yield (f"{specimen.name}: under {curve.mass:g} g the film loses tension from {slack[0]:g} kV on, over up "
                   f"to {percent(float(np.nanmax(curve.slack)))} of it")
        broken = curve.voltage[curve.margin < 1]
        if len(broken):
            yield f"{specimen.name}: under {curve.mass:g} g the film would break down from {broken[0]:g} kV on"
        if curve.pull_in is not None:
            below, above = curve.pull_in
            first = "at no voltage tried" if np.isnan(below) else f"only up to between {below:g} and {above:g} kV"
            again = curve.voltage[curve.found & (curve.voltage > above)]
            then = f"; there is one again from {again[0]:g} kV" if len(again) else ""
            yield (f"{specimen.name}: under {curve.mass:g} g there is an equilibrium {first}; beyond, the film "
                   f"pulls in{then}")
