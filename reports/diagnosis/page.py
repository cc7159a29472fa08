"""The report of a diagnosis: a page whose first screen needs no statistics, and its picture."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Template
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tympan.reports import look as style
from tympan.reports.template import embedded_picture, sentence, template
from tympan.studies.diagnosis.reading_table import LENGTHS
from tympan.studies.diagnosis.result import load_diagnosis
from tympan.studies.effects import EFFECTS
from tympan.studies.files import write_text

Content = Mapping[str, Any]

#: Standard deviations of the noise from which a ratio is clearly wrong.
CLEARLY = 3.0

_TITLE, _PANEL, _GAP, _AXIS, _LEGEND = 8.0, 34.0, 6.0, 11.0, 8.0  # heights [mm]
_LEFT, _RIGHT, _BETWEEN = 16.0, 3.0, 8.0


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


def draw_residuals(readings: Mapping[str, NDArray[Any]], folder: Path) -> list[Path]:
    """Draw folder/residuals.svg of columns of readings.csv, lengths in m; answers the files."""
    return style.save_figure(folder, "residuals", lambda: _compose(readings), ("svg",))


def _compose(readings: Mapping[str, NDArray[Any]]) -> Figure:
    """All panels with one scale."""
    names = list(dict.fromkeys(readings["specimen"].tolist()))
    before, after = (1e6 * (readings["read"] - readings[model])
                     for model in ("baseline", "extended"))
    height = _TITLE + len(names) * (_PANEL + _GAP) - _GAP + _AXIS + _LEGEND
    figure = style.new_figure(height)
    width = (style.WIDTH - _LEFT - _RIGHT - _BETWEEN) / 2
    changed = not np.array_equal(before, after)
    noise = float((1e6 * readings["sigma"]).max())
    reach = 1.15 * max(float(np.abs(before).max()), 2.5 * noise)
    titles = "nominal model, stiffness and permittivity fitted", "extended model"
    for row, name in enumerate(names):
        for column, (title, values) in enumerate(zip(titles, (before, after), strict=True)):
            axes = style.place_axes(figure, _LEFT + column * (width + _BETWEEN),
                                    _TITLE + row * (_PANEL + _GAP), width, _PANEL)
            _panel(axes, readings, name, values if column == 0 or changed else None)
            axes.set_ylim(-reach, reach)
            axes.set_title(title if row == 0 else "", loc="left", weight="bold")
            axes.set(ylabel=f"{name}\nread − model (µm)" if column == 0 else "",
                     xlabel="voltage (kV)" if row == len(names) - 1 else "")
            axes.tick_params(labelbottom=row == len(names) - 1, labelleft=column == 0)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=6)
    return figure


def _panel(axes: Axes, readings: Mapping[str, NDArray[Any]], name: str,
           values: NDArray[np.float64] | None) -> None:
    of_specimen = readings["specimen"] == name
    voltage, noise = readings["voltage"][of_specimen] / 1e3, 1e6 * readings["sigma"][of_specimen]
    order = np.argsort(voltage)
    edges, band = voltage[order], noise[order]
    if np.ptp(voltage) == 0:
        edges, band = np.array([voltage[0] - 0.5, voltage[0] + 0.5]), np.full(2, noise.max())
    axes.fill_between(edges, -2 * band, 2 * band, color="#e4e6ea", linewidth=0,
                      label="95 % of the noise")
    axes.axhline(0.0, color="#5a6475", linewidth=0.6)
    if values is None:
        axes.text(0.5, 0.8, "nothing to extend", transform=axes.transAxes, ha="center",
                  color="#5a6475")
        return
    for number, mass in enumerate(np.unique(readings["mass"]).tolist()):
        rows = of_specimen & (readings["mass"] == mass)
        axes.plot(readings["voltage"][rows] / 1e3, values[rows], style.marker_of(number),
                  color=style.colour_of(number), markersize=3.2, markeredgewidth=0, alpha=0.9,
                  label=f"{1e3 * mass:.4g} g")
