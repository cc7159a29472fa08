"""The report of a diagnosis: one HTML page whose first screen needs no statistics."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Template

from tympan.reports.diagnosis.residuals import draw_residuals
from tympan.reports.template import embedded_picture, sentence, template
from tympan.studies.diagnosis.reading_table import LENGTHS
from tympan.studies.diagnosis.result import load_diagnosis
from tympan.studies.effects import EFFECTS
from tympan.studies.files import write_text

Content = Mapping[str, Any]

#: Standard deviations of the noise from which a ratio is clearly wrong.
CLEARLY = 3.0

def build_diagnosis_page(folder: Path) -> Path:
    """Write folder/diagnosis.html from what a diagnosis stored there; answers that file."""
    content, columns = load_diagnosis(folder)
    lengths = np.isin(columns["kind"], LENGTHS)
    draw_residuals({name: values[lengths] for name, values in columns.items()}, folder)
    file = folder / "diagnosis.html"
    write_text(file, render_diagnosis(content, embedded_picture(folder / "residuals.svg")))
    return file


def render_diagnosis(content: Content, figure: str) -> str:
    """The page as text; the figure as a data URI."""
    return _template("reports/diagnosis/diagnosis.html").render(
        diagnosis=content, headline=headline(content["verdict"]), verdict=verdict_words(content),
        figure=figure, causes=_explained(content["causes"]),
        attempts=_explained(content["attempts"]))


def headline(verdict: str) -> str:
    """What a reader is told first."""
    return sentence(_template("reports/diagnosis/words.txt"), "headline", verdict)


def verdict_words(content: Content) -> str:
    """The verdict in one or two sentences.

    Examples
    --------
    >>> misfit = {"baseline_rmse_um": 21.0, "noise_um": 20.0, "where": "nowhere"}
    >>> verdict_words({"verdict": "nothing", "causes": [], "misfit": misfit, "after": None})[:55]
    'With stiffness and permittivity fitted, it misses the r'
    """
    causes = _explained(content["causes"])
    named = [cause for cause in causes
             if content["after"] and cause["label"] in content["after"]["effects"]]
    suspects = [cause for cause in causes if cause["probability"] >= 0.05][:4]
    return sentence(_template("reports/diagnosis/words.txt"), "verdict", content, named, suspects,
                    _worst_ratios(content["misfit"]))


def _worst_ratios(misfit: Content) -> list[Content]:
    """The worst ratio of strokes of each kind that is clearly wrong."""
    clear = [ratio for ratio in misfit.get("ratios", ()) if abs(ratio["off_by_noise"]) > CLEARLY]
    of_kind = [[ratio for ratio in clear if ratio["kind"] == kind] for kind in ("shape", "mass")]
    return [max(ratios, key=lambda ratio: abs(ratio["off_by_noise"])) for ratios in of_kind
            if ratios]


def _explained(causes: Iterable[Content]) -> list[Content]:
    """Causes with their names and what they mean."""
    return [{**cause, "label": cause_label(cause),
             "explanation": EFFECTS[cause["effect"]].explanation} for cause in causes]


def _template(name: str) -> Template:
    return template(name, number=number, error=error, probability=probability_text, chance=chance)


def cause_label(cause: Content) -> str:
    """An effect, with the specimen it happens to."""
    return cause["effect"] if cause["which"] is None else f"{cause['effect']} of {cause['which']}"


def number(value: float | None) -> str:
    """Three digits; infinity where there is none."""
    return "∞" if value is None else f"{value:.3g}"


def error(value: float | None) -> str:
    """An error; a dash where there is none."""
    return "–" if value is None else number(value)


def probability_text(share: float) -> str:
    """A probability, never rounded to certainty."""
    if not 0.01 <= share <= 0.99:
        return "above 99 %" if share > 0.5 else "below 1 %"
    return f"{100 * share:.0f} %"


def chance(p_value: float) -> str:
    """How often noise alone would look like that."""
    if p_value >= 0.01:
        return f"{100 * p_value:.0f} times in a hundred"
    times = 10 ** max(3, round(-np.log10(max(p_value, 1e-9))))
    return f"once in {times:,} times or less".replace(",", " ")
