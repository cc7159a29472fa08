"""The report of a diagnosis: a page whose first screen needs no statistics, and its picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Template
from matplotlib.figure import Figure

from tympan.base.arrays import AnyArray
from tympan.reports import look as style
from tympan.reports.diagnosis.figures import (
    compose_channels,
    compose_forces,
    compose_readings,
    compose_residuals,
    compose_transients,
)
from tympan.reports.diagnosis.film_maps import (
    FILM_COLOURINGS,
    compose_film_maps,
    compose_loaded_films,
    titled_films,
)
from tympan.reports.diagnosis.strip_figure import compose_strips
from tympan.reports.template import embedded_picture, sentence, template
from tympan.reports.viewer import viewer
from tympan.studies.data.checks import lines_of
from tympan.studies.diagnosis.evidence.registry import TRANSIENTS
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.verdict import SURE
from tympan.studies.diagnosis.reading_table import LENGTHS, UNITS
from tympan.studies.diagnosis.result import (
    CHANNELS,
    COUPONS,
    CURVES,
    READINGS,
    STRIPS,
    Attempt,
    Diagnosis,
    FoundCause,
    Misfit,
    Ratio,
    ReadingOff,
)
from tympan.studies.diagnosis.sentences import plain, probability_text, suspects_among
from tympan.studies.diagnosis.shown.curves import OTHERS
from tympan.studies.effects import EFFECTS
from tympan.studies.files import write_text

#: Standard deviations of the noise from which a ratio is clearly wrong.
CLEARLY = 3.0

#: File names of pictures that differ from the picture's name.
_FILES = {"readings": "curves", "loaded": "films"}

#: Pictures that the page may have.
_PICTURES = ("readings", "residuals", "forces", "channels", "frequencies", "transients", "film",
             "loaded", "strips")
#: End of the names of pictures with both models' residuals of a kind of readings, lengths excepted.
_LEFT = "_residuals"

#: Resolution of maps of films within the pictures [dpi].
_DPI = 200

#: Least probability of a cause outside the library that the text mentions.
_UNKNOWN = 0.1

#: Most effects that are listed where none explains what is wrong.
_TRIED = 4
#: Least share of the misfit that an effect must explain alone to be listed. With less its size is
#: zero within its error.
_WORTH = 0.02

#: Outliers in successive lines from which a moved sensor is suggested: a typing error affects one
#: line.
_SHIFTED = 3
#: Largest relative difference of the outliers' shifts from the first one's.
_ALIKE = 0.5


def build_diagnosis_page(diagnosis: Diagnosis, folder: Path) -> list[Path]:
    """Write folder/diagnosis.html with its pictures, and that of coupons; return the file."""
    tables = diagnosis.tables
    if STRIPS in tables:
        return _write(folder, diagnosis, {"strips": lambda: compose_strips(
            tables[STRIPS], diagnosis.coupon_reading or "stress")})
    columns, curves = tables[READINGS], tables[CURVES]
    lengths = np.isin(columns["kind"], LENGTHS)
    film, swings = ({name: values[columns["kind"] == kind] for name, values in columns.items()}
                    for kind in ("film", "frequency"))
    in_time = lengths & TRANSIENTS.wrote(columns["file"])
    runs, columns = ({name: values[rows] for name, values in columns.items()}
                     for rows in (in_time, lengths & ~in_time))
    pictures: dict[str, Callable[[], Figure]] = {}
    if len(columns["kind"]):
        pictures["readings"] = lambda: compose_readings(columns, curves)
        pictures["residuals"] = lambda: compose_residuals(columns)
    for name, kinds in {"forces": ("force",), "channels": OTHERS[1:]}.items():
        rows = np.isin(tables[READINGS]["kind"], kinds)
        if rows.any() and CHANNELS in tables:
            pictures |= _of_channel(name, *({key: values[np.isin(table["kind"], kinds)]
                                             for key, values in table.items()}
                                            for table in (tables[READINGS], tables[CHANNELS])))
    if len(swings["kind"]):
        pictures["frequencies"] = lambda: compose_residuals(swings, "Hz", 1.0)
    if len(runs["kind"]):
        pictures["transients"] = lambda: compose_transients(runs)
    if len(film["kind"]):
        pictures["film"] = lambda: compose_film_maps(film, diagnosis.films)
    films = titled_films(diagnosis.loaded_films)
    if films:
        pictures["loaded"] = lambda: compose_loaded_films(films)
    if diagnosis.coupons is not None:
        build_diagnosis_page(diagnosis.coupons, folder / COUPONS)
    return _write(folder, diagnosis, pictures, viewer(films, FILM_COLOURINGS) if films else "")


def _of_channel(name: str, readings: Mapping[str, AnyArray], curves: Mapping[str, AnyArray]
                ) -> dict[str, Callable[[], Figure]]:
    """List pictures of forces or of channels: readings with curves, and both models' residuals."""
    if name == "forces":
        unit = UNITS["force"]
        return {"forces": lambda: compose_forces(readings, curves),
                "force" + _LEFT: lambda: compose_residuals(
                    readings, unit.name, unit.per_si, "displacement", "voltage")}
    pictures = {"channels": lambda: compose_channels(readings, curves)}
    for kind in dict.fromkeys(readings["kind"].tolist()):
        rows = readings["kind"] == kind
        pictures[kind + _LEFT] = partial(
            compose_residuals, {key: values[rows] for key, values in readings.items()},
            UNITS[kind].name, UNITS[kind].per_si)
    return pictures


def _write(folder: Path, diagnosis: Diagnosis, pictures: Mapping[str, Callable[[], Figure]],
           shown: str = "") -> list[Path]:
    """Draw the pictures and write the page."""
    for name, compose in pictures.items():
        style.save_figure(folder, _FILES.get(name, name), compose, ("svg",), _DPI)
    file = folder / "diagnosis.html"
    embedded = {name: embedded_picture(folder / f"{_FILES.get(name, name)}.svg")
                for name in pictures}
    write_text(file, render_diagnosis(diagnosis, embedded, shown))
    return [file]


def render_diagnosis(diagnosis: Diagnosis, pictures: Mapping[str, str], viewer: str = "") -> str:
    """Render the page as text; pictures are data URIs by name, rotatable films are HTML."""
    attempts = [one for one in diagnosis.attempts if one.explains >= _WORTH]
    tried = attempts[:_TRIED] if diagnosis.verdict == "unexplained" else []
    unit = _unit(diagnosis)
    return _template("reports/diagnosis/diagnosis.html").render(
        diagnosis=diagnosis, verdict=verdict_words(diagnosis), viewer=viewer, unit=unit,
        attempts=attempts, worth=100 * _WORTH, tried=tried, suspects=_suspects(diagnosis),
        gain=gain_words(diagnosis),
        robust=_said("robust", diagnosis), noise=_said("noise", diagnosis.misfit, unit),
        more=[(name.removesuffix(_LEFT).replace("_", " "), picture)
              for name, picture in pictures.items() if name.endswith(_LEFT)],
        **dict.fromkeys(_PICTURES, "") | dict(pictures))


def gain_words(diagnosis: Diagnosis) -> str:
    """Write sentences on the extended model's predictions of held-out readings."""
    return _said("gain", diagnosis, _unit(diagnosis))


def verdict_words(diagnosis: Diagnosis) -> str:
    """Write the sentences that follow the headline."""
    named = [cause for cause in diagnosis.causes if diagnosis.verdict == "named" and cause.named]
    words = _said("verdict", diagnosis, named, _suspects(diagnosis),
                  _worst_ratios(diagnosis.misfit), _unit(diagnosis),
                  diagnosis.probability.unknown >= _UNKNOWN, 100 * SURE)
    return " ".join(filter(None, (words, _said("told", diagnosis, _unit(diagnosis)))))


def readings_words(diagnosis: Diagnosis) -> str:
    """Count readings and their films or strips in words, such as 56 readings of 3 films."""
    counts = []
    for part in (diagnosis, diagnosis.coupons):
        for name, what in ((READINGS, "film"), (STRIPS, "strip")):
            if part is not None and name in part.tables:
                read = part.tables[name]["specimen"]
                several = len({*read})
                counts.append(f"{len(read)} readings of {several} {what}{'s' * (several != 1)}")
    return " and ".join(counts)


def _unit(diagnosis: Diagnosis) -> str:
    """Name the unit of errors as it is printed."""
    return diagnosis.unit.replace("u", "µ")


def _suspects(diagnosis: Diagnosis) -> list[FoundCause]:
    return suspects_among(diagnosis.causes) if diagnosis.verdict == "ambiguous" else []


def _said(part: str, *values: Any) -> str:
    return sentence(_template("reports/diagnosis/words.txt"), part, *values)


def _worst_ratios(misfit: Misfit) -> list[Ratio]:
    """Find the worst ratio of strokes of each kind that is clearly wrong."""
    clear = [ratio for ratio in misfit.ratios if abs(ratio.off_by_noise) > CLEARLY]
    of_kind = [[ratio for ratio in clear if ratio.kind == kind] for kind in ("shape", "mass")]
    return [max(ratios, key=lambda ratio: abs(ratio.off_by_noise)) for ratios in of_kind if ratios]


def _template(name: str) -> Template:
    return template(name, number=three_digits, digits=five_digits, like=like, error=error,
                    chance=chance, probability=probability_text, plain=plain,
                    capitalised=capitalised, times=times, label=cause_label, shifted=shifted,
                    lines=lambda numbers: lines_of(np.array(numbers)),
                    explanation=lambda cause: EFFECTS[cause.effect].explanation)


def cause_label(cause: FoundCause | Attempt) -> str:
    """Name an effect, with the specimen it acts on."""
    again = isinstance(cause, FoundCause) and cause.again
    return str(Cause(cause.effect, cause.which, again))


def three_digits(value: float | None) -> str:
    """Write three digits, without a power of ten up to a million; infinity where there is none.

    >>> three_digits(7912.0), three_digits(0.0312)
    ('7910', '0.0312')
    """
    return "∞" if value is None else f"{float(f'{value:.3g}'):g}"


def five_digits(value: float) -> str:
    """Write five digits, as readings are written."""
    return f"{value:.5g}"


def like(value: float, written: float) -> str:
    """Write a value with as many decimals as the written one has, and at least three digits.

    >>> like(3.25512, 2.844), like(0.31412, 0.3)
    ('3.255', '0.314')
    """
    decimals = len(five_digits(written).partition(".")[2])
    least = 2 - int(np.floor(np.log10(abs(value)))) if value else 0
    return f"{value:.{max(decimals, least, 0)}f}"


def error(value: float | None) -> str:
    """Write an error; a dash where there is none."""
    return "–" if value is None else three_digits(value)


def times(factor: float) -> str:
    """Write a factor in words, such as "3 times".

    >>> times(3.14), times(4001.1)
    ('3.1 times', '4000 times')
    """
    return f"{float(f'{factor:.2g}'):g} times"


def shifted(off: Sequence[ReadingOff]) -> tuple[ReadingOff, ReadingOff, float] | None:
    """Find the longest series of outliers in successive lines with about the same shift.

    Return its first and last outlier and the shift; None where fewer than three are in series.
    """
    most: list[tuple[ReadingOff, float]] = []
    shifts = [(reading, reading.read - reading.expected) for reading in off]
    for start, (_, shift) in enumerate(shifts):
        group = shifts[start:start + 1]
        for (before, _), (reading, other) in pairwise(shifts[start:]):
            if ((reading.file, reading.line) != (before.file, before.line + 1)
                    or abs(other - shift) > _ALIKE * abs(shift)):
                break
            group.append((reading, other))
        most = max(most, group, key=len)
    if len(most) < _SHIFTED:
        return None
    return most[0][0], most[-1][0], float(np.median([shift for _, shift in most]))


def capitalised(words: str) -> str:
    """Capitalise the first letter of words."""
    return words[:1].upper() + words[1:]


def chance(p_value: float) -> str:
    """Write how often noise alone would look like that, at least once in a million.

    >>> chance(0.14), chance(0.0004), chance(1e-16)
    ('14 times in a hundred', 'at most once in 1 000 times', 'at most once in 1 000 000 times')
    """
    if p_value >= 0.01:
        return f"{100 * p_value:.0f} times in a hundred"
    times = 10 ** int(-np.log10(max(p_value, 1e-6)))
    return f"at most once in {times:,} times".replace(",", " ")
