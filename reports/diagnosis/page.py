"""The report of a diagnosis: a page whose first screen needs no statistics, and its picture."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Template
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.reports.diagnosis.figures import compose_readings, compose_residuals, compose_transients
from tympan.reports.diagnosis.film_maps import (
    QUANTITIES,
    compose_film_maps,
    compose_loaded_films,
    titled_films,
)
from tympan.reports.diagnosis.strip_figure import compose_strips
from tympan.reports.template import embedded_picture, sentence, template
from tympan.reports.viewer import viewer
from tympan.studies.diagnosis.reading_table import KILOPASCALS, LENGTHS, MICROMETRES
from tympan.studies.diagnosis.result import COUPONS, load_diagnosis
from tympan.studies.diagnosis.sentences import plain, probability_text, suspects_among
from tympan.studies.diagnosis.shown.loaded_films import load_films
from tympan.studies.effects import EFFECTS
from tympan.studies.files import write_text

Content = Mapping[str, Any]

#: Standard deviations of the noise from which a ratio is clearly wrong.
CLEARLY = 3.0

#: Files of pictures that are not called as what they show.
_FILES = {"readings": "curves", "loaded": "films"}

#: Of maps of films within the pictures.
_DPI = 200

#: Names of the units of errors.
UNITS = (MICROMETRES.name, KILOPASCALS.name)

#: Effects told of where none explains what is wrong.
_TRIED = 4


def build_diagnosis_page(folder: Path) -> Path:
    """Write folder/diagnosis.html from what a diagnosis stored there; answers that file."""
    content, columns, curves = load_diagnosis(folder)
    if "leg" in columns:
        return _write(folder, content, {
            "strips": lambda: compose_strips(columns, content["coupon_reading"])})
    lengths = np.isin(columns["kind"], LENGTHS)
    film = {name: values[columns["kind"] == "film"] for name, values in columns.items()}
    in_time = lengths & np.char.startswith(columns["file"].astype(str), "transient.")
    runs, columns = ({name: values[rows] for name, values in columns.items()}
                     for rows in (in_time, lengths & ~in_time))
    pictures: dict[str, Callable[[], Figure]] = {}
    if len(columns["kind"]):
        pictures["readings"] = lambda: compose_readings(columns, curves)
        pictures["residuals"] = lambda: compose_residuals(columns)
    if len(runs["kind"]):
        pictures["transients"] = lambda: compose_transients(runs)
    if len(film["kind"]):
        pictures["film"] = lambda: compose_film_maps(film, content["films"])
    films = titled_films(load_films(folder, content))
    if films:
        pictures["loaded"] = lambda: compose_loaded_films(films)
    if (folder / COUPONS).is_dir():
        build_diagnosis_page(folder / COUPONS)
    return _write(folder, content, pictures, viewer(films, QUANTITIES) if films else "")


def _write(folder: Path, content: Content, pictures: Mapping[str, Callable[[], Figure]],
           shown: str = "") -> Path:
    """Draw the pictures and write the page."""
    for name, compose in pictures.items():
        style.save_figure(folder, _FILES.get(name, name), compose, ("svg",), _DPI)
    file = folder / "diagnosis.html"
    embedded = {name: embedded_picture(folder / f"{_FILES.get(name, name)}.svg")
                for name in pictures}
    write_text(file, render_diagnosis(content, viewer=shown, **embedded))
    return file


def render_diagnosis(content: Content, readings: str = "", residuals: str = "",
                     transients: str = "", film: str = "", loaded: str = "", strips: str = "",
                     viewer: str = "") -> str:
    """The page as text; pictures as data URIs and films to turn as HTML, "" where there is none."""
    content = in_its_unit(content)
    attempts = _explained(content["attempts"])
    tried = attempts[:_TRIED] if content["verdict"] == "unexplained" else []
    return _template("reports/diagnosis/diagnosis.html").render(
        diagnosis=content, verdict=verdict_words(content), readings=readings, residuals=residuals,
        transients=transients, film=film, loaded=loaded, strips=strips, viewer=viewer,
        unit=content["unit"],
        causes=_explained(content["causes"]), attempts=attempts, tried=tried,
        suspects=_suspects(content), gain=_said("gain", content), robust=_said("robust", content),
        noise=_said("noise", content["misfit"], content["unit"]))


def in_its_unit(content: Content) -> dict[str, Any]:
    """The content with its unit for errors as "unit" and without it in the names of its numbers.

    Examples
    --------
    >>> in_its_unit({"misfit": {"noise_kPa": 0.2}})
    {'misfit': {'noise': 0.2}, 'unit': 'kPa'}
    """
    if "unit" in content:
        return dict(content)
    unit = next((name for name in UNITS if f"noise_{name}" in content["misfit"]), "um")
    renamed: dict[str, Any] = _without(content, f"_{unit}")
    return {**renamed, "unit": unit.replace("u", "µ")}


def _without(content: Any, ending: str) -> Any:
    """A JSON value, no key of which has that ending."""
    if isinstance(content, Mapping):
        return {key.removesuffix(ending): _without(value, ending) for key, value in content.items()}
    if isinstance(content, list):
        return [_without(value, ending) for value in content]
    return content


def verdict_words(content: Content) -> str:
    """What follows the headline, in a few sentences.

    Examples
    --------
    >>> misfit = {"baseline_rmse_um": 21.0, "noise_um": 20.0, "where": "nowhere"}
    >>> verdict_words({"verdict": "nothing", "causes": [], "misfit": misfit, "after": None})[:55]
    'With stiffness and permittivity fitted, the nominal mod'
    """
    content = in_its_unit(content)
    named = [cause for cause in _explained(content["causes"])
             if content["verdict"] == "named" and cause["named"]]
    return _said("verdict", content, named, _suspects(content), _worst_ratios(content["misfit"]))


def _suspects(content: Content) -> list[dict[str, Any]]:
    causes = _explained(content["causes"])
    return suspects_among(causes) if content["verdict"] == "ambiguous" else []


def _said(part: str, *values: Any) -> str:
    return sentence(_template("reports/diagnosis/words.txt"), part, *values)


def _worst_ratios(misfit: Content) -> list[Content]:
    """The worst ratio of strokes of each kind that is clearly wrong."""
    clear = [ratio for ratio in misfit.get("ratios", ()) if abs(ratio["off_by_noise"]) > CLEARLY]
    of_kind = [[ratio for ratio in clear if ratio["kind"] == kind] for kind in ("shape", "mass")]
    return [max(ratios, key=lambda ratio: abs(ratio["off_by_noise"])) for ratios in of_kind
            if ratios]


def _explained(causes: Iterable[Content]) -> list[dict[str, Any]]:
    """Causes with their names and what they mean."""
    return [{**cause, "label": cause_label(cause),
             "explanation": EFFECTS[cause["effect"]].explanation} for cause in causes]


def _template(name: str) -> Template:
    return template(name, number=number, error=error, probability=probability_text, chance=chance,
                    plain=plain, capitalised=capitalised, times=times)


def cause_label(cause: Content) -> str:
    """An effect, with the specimen it happens to."""
    return cause["effect"] if cause["which"] is None else f"{cause['effect']} of {cause['which']}"


def number(value: float | None) -> str:
    """Three digits, without a power of ten up to a million; infinity where there is none.

    >>> number(7912.0), number(0.0312)
    ('7910', '0.0312')
    """
    return "∞" if value is None else f"{float(f'{value:.3g}'):g}"


def error(value: float | None) -> str:
    """An error; a dash where there is none."""
    return "–" if value is None else number(value)


def times(factor: float) -> str:
    """How many times something."""
    return f"{factor:.2g} times"


def capitalised(words: str) -> str:
    """With a capital at the beginning."""
    return words[:1].upper() + words[1:]


def chance(p_value: float) -> str:
    """How often noise alone would look like that."""
    if p_value >= 0.01:
        return f"{100 * p_value:.0f} times in a hundred"
    times = 10 ** max(3, round(-np.log10(max(p_value, 1e-9))))
    return f"once in {times:,} times or less".replace(",", " ")
