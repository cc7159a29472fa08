"""The report of a diagnosis: one self-contained HTML page whose first screen needs no statistics."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tympan.geometry.errors import InputError
from tympan.reports.diagnosis import residuals
from tympan.reports.diagnosis.residuals import Residuals
from tympan.reports.template import embedded_picture, page_template, sentence_list
from tympan.studies.effects import REGISTRY
from tympan.studies.files import write_text

Content = Mapping[str, Any]

#: Standard deviations of the noise from which a ratio is clearly wrong.
CLEARLY = 3.0

#: What a reader is told first.
HEADLINES = {
    "nothing": "The simulation agrees with these readings.",
    "named": "The simulation is wrong, and the cause stands out.",
    "ambiguous": "The simulation is wrong, and more than one cause could explain it.",
    "unexplained": "The simulation is wrong, and no effect in the library explains it.",
}


def build_diagnosis_page(folder: Path) -> Path:
    """Write folder/diagnosis.html from what a diagnosis stored there; answers that file.

    Raises
    ------
    InputError
        When diagnosis.json or readings.csv is missing or damaged.
    """
    content, table = _read(folder)
    residuals.draw_residuals(table, folder)
    file = folder / "diagnosis.html"
    write_text(file, render_diagnosis(content, embedded_picture(folder / "residuals.svg")))
    return file


def render_diagnosis(content: Content, figure: str) -> str:
    """The page as text; the figure as a data URI."""
    template = page_template("diagnosis/diagnosis.html", number=number, percent=probability_text,
                             chance=chance, error=error)
    return template.render(
        found=content, headline=HEADLINES[content["verdict"]],
        sentence=verdict_sentence(content),
        figure=figure, causes=[told(one) for one in content["causes"]],
        attempts=[told(one) for one in content["attempts"]])


def told(cause: Content) -> Content:
    """A cause with its words."""
    return {**cause, "label": cause_label(cause), "values": values(cause),
            "explanation": REGISTRY[cause["effect"]].explanation}


def verdict_sentence(content: Content) -> str:
    """The verdict in one or two sentences.

    Examples
    --------
    >>> misfit = {"baseline_rmse_um": 21.0, "noise_um": 20.0, "where": "nowhere"}
    >>> verdict_sentence({"verdict": "nothing", "causes": [], "misfit": misfit, "after": None})
    'With stiffness and permittivity fitted, it misses the readings by 21 µm; the noise alone is 20 µm.'
    """
    misfit, causes = content["misfit"], content["causes"]
    missed = (f"With stiffness and permittivity fitted, it misses the readings by {number(misfit['baseline_rmse_um'])} "
              f"µm; the noise alone is {number(misfit['noise_um'])} µm")
    if content["verdict"] == "nothing":
        return f"{missed}."
    missed = f"{missed}: {misfit['where']}."
    if content["verdict"] == "unexplained":
        return (f"{missed}{ratio_words(misfit)} Something is at work that tympan does not know, or the dataset states "
                "something wrongly.")
    if content["verdict"] == "named":
        named = [one for one in causes if cause_label(one) in content["after"]["effects"]]
        told = " ".join(f"{REGISTRY[one['effect']].explanation} Found: {values(one)}."
                        for one in named)
        return f"{missed} {told} With that it misses them by {number(content['after']['rmse_um'])} µm."
    several = [cause_label(one) for one in causes if one["probability"] >= 0.05][:4]
    return f"{missed} These readings cannot decide between {sentence_list(several)}."


def ratio_words(misfit: Content) -> str:
    """The worst ratio of strokes of each kind that is clearly wrong."""
    found = []
    for kind in ("shape", "mass"):
        worst = max((one for one in misfit["ratios"] if one["kind"] == kind
                     and abs(one["off_by_noise"]) > CLEARLY),
                    key=lambda one: abs(one["off_by_noise"]), default=None)
        if worst:
            found.append(f"{worst['what']} is {worst['read']:.2f} as read, {worst['simulated']:.2f} as simulated")
    return f" The ratio of strokes {sentence_list(found)}." if found else ""


def cause_label(cause: Content) -> str:
    """An effect, with the specimen it happens to."""
    return cause["effect"] if cause["which"] is None else f"{cause['effect']} of {cause['which']}"


def values(cause: Content) -> str:
    """The parameters of a cause with their limits."""
    return ", ".join(
        f"{name} = {number(one['value'])} {one['unit']} (95 %: {number(one['low'])} to {number(one['high'])})"
        .replace("  ", " ") for name, one in cause["parameters"].items())


def number(value: float | None) -> str:
    """Three digits; infinity where there is none."""
    return "∞" if value is None else f"{value:.3g}"


def error(value: float | None) -> str:
    """An error; a dash where there is none."""
    return "–" if value is None else number(value)


def probability_text(share: float) -> str:
    """A probability, never rounded to certainty."""
    return "above 99 %" if share > 0.99 else "below 1 %" if share < 0.01 else f"{100 * share:.0f} %"


def chance(p_value: float) -> str:
    """How often noise alone would look like that."""
    if p_value >= 0.01:
        return f"{100 * p_value:.0f} times in a hundred"
    return f"once in {10 ** max(3, round(-np.log10(max(p_value, 1e-9)))):,} times or less".replace(",", " ")


def _read(folder: Path) -> tuple[Content, Residuals]:
    try:
        content = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
        with (folder / "readings.csv").open(encoding="utf-8", newline="") as stream:
            rows = [row for row in csv.DictReader(stream) if row["kind"] in ("displacement",
                                                                             "range")]
        column = {name: np.array([float(row[name]) for row in rows])
                  for name in ("mass_g", "voltage_kV", "read", "sigma", "baseline", "extended")}
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"cannot be read: {error}; run tympan diagnose again",
                         file=folder) from None
    return content, Residuals(np.array([row["specimen"] for row in rows]), column["mass_g"],
                              column["voltage_kV"],
                              1e6 * (column["read"] - column["baseline"]),
                              1e6 * (column["read"] - column["extended"]),
                              1e6 * column["sigma"])
