"""Lines that commands print, written in Python: single lines, and the whole text of quick commands.

To load the template engine and to compile a template takes longer than to solve a film, so what
``solve`` and ``limits`` print needs neither. The other commands have templates in text/.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from tympan.base.units import segment_words

if TYPE_CHECKING:
    from tympan.geometry.outlines import Outline
    from tympan.geometry.specimen import Plate, Specimen
    from tympan.studies.case import Band, CaseResult, Limits

#: Fields of a solved case that its text does not list: the lines above and below have them.
_ELSEWHERE = ("specimen", "bands", "limits", "first", "limit", "equilibria", "dofs", "wall_s",
              "slack_share", "breakdown_share", "segments", "charge_by_voltage_F")
#: Bands of a solved case: key, words, unit, and their number in one SI unit.
_BANDS = (("deflection_m", "deflection", "mm", 1e3), ("stroke_m", "stroke", "mm", 1e3),
          ("capacitance_F", "capacitance", "pF", 1e12))
#: Capacitance below which no digit is printed [F].
_NO_CAPACITANCE = 1e-15
#: Motions of a plate that loads, film and voltages may leave straight.
_ASLANT = ("tilt_x_rad", "tilt_y_rad", "shift_x_m", "shift_y_m")
#: Tilt [rad] and shift [m] below which a plate is straight: rounding.
_NO_MOTION = 1e-11
#: Half extents that differ by less [m] are shown as one.
_ROUND = 1e-9


def solved_text(record: dict[str, Any], result: CaseResult, specimen: Specimen,
                entries: Callable[..., str], **_: Any) -> str:
    """Write what ``solve`` prints: the specimen, the numbers, bands and limits."""
    hidden = list(_ELSEWHERE)
    if record["reading_m"] == record["deflection_m"]:
        hidden.append("reading_m")
    if not record["slack_area_m2"]:
        hidden.append("slack_area_m2")
    if all(not record[key] or abs(record[key]) < _NO_MOTION for key in _ASLANT):
        hidden += _ASLANT
    lines = [specimen_line(specimen), entries(record, *hidden), *_segment_lines(result)]
    lines += [f"stable at {1e3 * each['deflection_m']:.4g} mm"
              + " (reached from the mounted plate)" * each["reached"]
              for each in record["equilibria"]]
    lines += [band_line(result.bands[key], words, unit, factor)
              for key, words, unit, factor in _BANDS if key in result.bands]
    return "\n".join(lines + ([limit_lines(result.limits)] if result.limits else []))


def _segment_lines(result: CaseResult) -> Iterator[str]:
    """Write a line for each segment, with its row of the capacitance matrix."""
    segments, matrix = result.segments, result.charge_by_voltage_F
    width = max((len(each.name) for each in segments), default=0)
    for each in segments:
        margin = ("" if each.breakdown_margin is None
                  else f", margin to breakdown {each.breakdown_margin:.3g}")
        yield (f"segment {each.name:<{width}}  {each.voltage_V / 1e3:.4g} kV  "
               f"{1e12 * each.capacitance_F:.5g} pF  "
               f"field {each.max_field_V_per_m / 1e6:.4g} MV/m{margin}")
    if matrix:
        yield ("charge by voltage where film and plate follow (pF), a row a segment, columns "
               + ", ".join(each.name for each in segments))
    for each, row in zip(segments, matrix, strict=False):
        yield f"        {each.name:<{width}}  " + "  ".join(f"{_pF(value):>9s}" for value in row)


def _pF(value: float) -> str:
    """Write a capacitance; what is less than a thousandth of a picofarad is 0."""
    return f"{1e12 * value:.5g}" if abs(value) >= _NO_CAPACITANCE else "0"


def limits_text(record: dict[str, Any], options: argparse.Namespace, limits: Limits,
                plate: Plate | None, pressure: float, **_: Any) -> str:
    """Write what ``limits`` prints: the load, the stroke, each limit and the warnings."""
    over = f" over gas of {pressure:.4g} Pa" if pressure else ""
    load = f" without plate{over}" if plate is None else (
        f" under {1e3 * record['mass_kg']:.4g} g"
        + " (chosen for this film)" * (options.mass is None))
    stroke = stroke_line(record["stroke_m"], limits)
    lines = [record["specimen"] + load, *([stroke] if stroke else []), limit_lines(limits)]
    return "\n".join(lines + [f"warning: {warning}" for warning in record["warnings"]])


def specimen_line(specimen: Specimen) -> str:
    """Write a specimen as it was read; sizes are from edge to edge."""
    film, plate = specimen.membrane, specimen.plate
    if plate is None:
        held = "no plate"
    else:
        held = f"plate {_sized(plate.outline)}"
        if any(plate.offset):
            held += " at {:.4g}, {:.4g} mm".format(*(1e3 * place for place in plate.offset))
    films = f"{film.layers} films, each" if film.layers > 1 else "film"
    mounted = 1e6 * film.thickness / film.area_prestretch
    first, second = film.prestretch
    return (f"{specimen.name}: frame {_sized(specimen.frame)}, {held}, {films} {mounted:.4g} µm "
            f"mounted ({1e6 * film.thickness:.4g} µm × stretch {first:.4g}, {second:.4g})")


def _sized(outline: Outline) -> str:
    a, b = outline.semi_axes
    across = f" × {2e3 * b:.4g}" if abs(a - b) > _ROUND else ""
    return f"{outline.shape.replace('_', ' ')} {2e3 * a:.4g}{across} mm"


def stroke_line(stroke: float | None, limits: Limits) -> str:
    """Write how far the plate moves on the way to the first limit; "" without a plate."""
    if stroke is None:
        return ""
    end = "to the first limit" if limits.limit else "on, as far as the film was followed"
    return f"stroke          {1e3 * stroke:.4g} mm from 0 kV {end}"


def limit_lines(limits: Limits) -> str:
    """Write a line for each limit, in the order in which they come, and how the film ends."""
    return "\n".join(_limit_lines(limits))


def _limit_lines(limits: Limits) -> Iterator[str]:
    for number, limit in enumerate(limits.told):
        first = "   (the limit)" if number == 0 else ""
        yield f"{limit.state.label:<15s} {limit.text}   first at {limit.place}{first}"
        if limit.drive:
            yield f"                with {limit.drive}"
        if limit.advice:
            yield f"                {limit.advice}"
    if limits.thins:
        yield limits.ended + ("; the pull-in is that of a film kept from wrinkling"
                              if limits.pull_in is not None else "")
    elif limits.pull_in is None:
        yield limits.ended


def band_line(band: Band, words: str, unit: str, factor: float) -> str:
    """Write the median of random films, and the range of nine in ten of them."""
    median, low, high = (f"{factor * value:.4g}" for value in (band.median, band.low, band.high))
    return f"{words:<14s} median {median} {unit}, 90 % of the films from {low} to {high} {unit}"


#: Functions of this module that templates use as filters.
FILTERS: Sequence[Callable[..., str]] = (specimen_line, stroke_line, limit_lines, band_line,
                                         segment_words)
