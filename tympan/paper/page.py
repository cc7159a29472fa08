"""The page of ``tympan lumped paper``: the paper's figures in its axes, its numbers and ours."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.base.arrays import Array
from tympan.paper.figures import ZOOM
from tympan.paper.output import PaperResult
from tympan.paper.published import MASSES, NAMES, SETTLING, SINES, STEP
from tympan.reports import look as style
from tympan.reports.template import embedded_picture, sentence, template
from tympan.studies.files import write_text

Content = dict[str, Any]
#: Abscissa and ordinate of curves, by file and by the labels in its first columns.
Curves = Mapping[str, Mapping[tuple[str, ...], Array]]

#: Height of a single axis [mm].
_HEIGHT = 70.0

_LETTERS = "abcdef"

#: Method by which each set of weights α was found.
BASES = {"membrane": "circles of the same film, by finite elements",
         "cone": "the paper's straight cones, Eq. (5)",
         "cone_scaled": "these cones times one factor, found on the first circle",
         "from_fields": "shares of the plate's edge force within 45° of each axis; no fit"}


def build_paper_page(result: PaperResult, folder: Path) -> list[Path]:
    """Draw the figures and write folder/paper.html; return that file."""
    draw_paper(result, folder)
    file = folder / "paper.html"
    pictures = {name: embedded_picture(folder / f"{name}.svg") for name in FIGURES}
    write_text(file, render_paper(result.numbers, pictures))
    return [file]


def render_paper(content: Content, pictures: Mapping[str, str]) -> str:
    """Render the page as text; figures are data URIs."""
    columns = [f"{name}_{1e3 * mass:g}g_s" for mass in MASSES for name in NAMES]
    return template("paper/paper.html", number_text=number_text).render(
        paper=content, pictures=pictures, columns=columns, bases=BASES,
        paper_settling=SETTLING.ravel().tolist(), masses=[1e3 * mass for mass in MASSES],
        names=NAMES)


def caption(name: str) -> str:
    """Read the caption of a figure.

    Examples
    --------
    >>> caption("fig10")
    'Figure 10: the same, its beginning.'
    """
    return sentence(template("paper/captions.txt"), "caption", name)


def number_text(number: Content) -> str:
    """Write a number of a finding in its usual unit.

    Examples
    --------
    >>> number_text({"value": 231610.0, "unit": "Pa"}), number_text({"value": 1.25, "unit": ""})
    ('231.6 kPa', '1.25')
    """
    units = {"Pa": ("kPa", 1e-3), "m": ("mm", 1e3), "kg": ("g", 1e3), "m²": ("cm²", 1e4)}
    unit, factor = units.get(number["unit"], (number["unit"], 1.0))
    return f"{factor * number['value']:.4g} {unit}".strip()


def draw_paper(result: PaperResult, folder: Path) -> list[Path]:
    """Draw folder/fig7 … fig14 and folder/misfit; return the files."""
    return [file for name, compose in FIGURES.items() for file in style.save_figure(
        folder, name, partial(compose, result.numbers, result.curves))]


def _static(content: Content, curves: Curves, mass: float) -> Figure:
    figure, axes = _single()
    for colour, name, (volts, y) in _three(curves["static"], mass):
        row = _ranges(content, mass, name)
        axes.plot(volts, y, color=colour,
                  label=f"{name}: range {row['at_rest_mm']:.2f} mm (paper, over steps: "
                        f"{row['paper_mm']:.2f} mm)")
    axes.legend(loc="upper left")
    style.describe(axes, "voltage (kV)", "distance (mm)")
    return figure


def _step(content: Content, curves: Curves, mass: float, end: float = np.inf) -> Figure:
    figure, axes = _single()
    zoom = np.isfinite(end)
    for colour, name, (time, y) in _three(curves["step"], mass):
        shown = time <= end
        settled = SETTLING[MASSES.index(mass), NAMES.index(name)]
        ours = content["settling"]["rows"][0][f"{name}_{1e3 * mass:g}g_s"]
        axes.plot(time[shown], y[shown], color=colour, linewidth=0.8,
                  label=f"{name}: {ours:.2f} s (paper: {settled:.2f} s)" if zoom else name)
        if zoom:
            for at, marker in ((ours, "o"), (settled, "v")):
                axes.plot(at, np.interp(at, time, y), marker, color=colour,
                          markeredgecolor="black", markersize=5, markeredgewidth=0.6)
    axes.set_xlim(0, end if zoom else None)
    axes.set_ylim(top=axes.get_ylim()[1] + 0.25 * np.ptp(axes.get_ylim()))
    axes.legend(loc="upper right")
    style.describe(axes, "time (s)", "distance (mm)",
                   f"step {STEP[0] / 1e3:g} to {STEP[1] / 1e3:g} kV at 0 s, {1e3 * mass:g} g"
                   + (", settled: ○ within 5 % of the largest swing, ▽ paper" if zoom else ""))
    return figure


def _loops(content: Content, curves: Curves) -> Figure:
    height, gap, margin = 42.0, 11.0, 16.0
    figure = style.new_figure(style.TITLE + 3 * (height + gap))
    width = style.WIDTH / 2 - margin - style.RIGHT
    for row, name in enumerate(NAMES):
        for column, (offset, amplitude) in enumerate(SINES):
            axes = style.place_axes(figure, margin + column * style.WIDTH / 2,
                                    style.TITLE + row * (height + gap), width, height)
            volts, y = curves["hysteresis"][f"{offset / 1e3:g}", f"{amplitude / 1e3:g}", name]
            axes.plot(np.append(volts, volts[0]), np.append(y, y[0]), color=style.PALETTE[row])
            title = (f"({_LETTERS[2 * row + column]}) {name}, u₀ = {offset / 1e3:g} kV, "
                     f"u₁ = {amplitude / 1e3:g} kV")
            style.describe(axes, "voltage (kV)" if row == 2 else "",
                           "distance (mm)" if column == 0 else "", title)
            axes.locator_params(axis="x", nbins=8)
    return figure


def _random(content: Content, curves: Curves) -> Figure:
    (time, volts), = curves["signal"].values()
    heights = (26.0, 48.0, 48.0)
    figure = style.new_figure(sum(heights) + 3 * (style.TITLE + 2) + style.AXIS - 2)
    top, width = style.TITLE, style.WIDTH - style.LEFT - style.RIGHT
    for number, height in enumerate(heights):
        axes = style.place_axes(figure, style.LEFT, top, width, height)
        top += height + style.TITLE + 2
        if number == 0:
            axes.plot(time, volts, color="black", linewidth=0.8)
            style.describe(axes, "", "voltage (kV)", "(a) applied voltage")
        else:
            mass = MASSES[number - 1]
            for colour, name, (at, y) in _three(curves["random"], mass):
                row = _ranges(content, mass, name)
                axes.plot(at, y, color=colour, linewidth=0.7,
                          label=f"{name} {row['at_levels_mm']:.2f} mm (paper "
                                f"{row['paper_mm']:.2f})")
            style.describe(
                axes, "time (s)" if number == 2 else "", "distance (mm)",
                f"({_LETTERS[number]}) {1e3 * mass:g} g, ranges at the ends of the levels")
            axes.set_ylim(top=axes.get_ylim()[1] + 0.14 * np.ptp(axes.get_ylim()))
            axes.legend(loc="upper right", ncols=3, handlelength=1.2, columnspacing=1.0)
        axes.set_xlim(0, time[-1])
        axes.tick_params(labelbottom=number == 2)
    return figure


def _misfit(content: Content, curves: Curves) -> Figure:
    columns = curves["misfit"]
    permittivity = np.array([float(key) for (key,) in columns])
    alpha = next(iter(columns.values()))[0]
    worst = np.array([pair[1] for pair in columns.values()])
    figure, axes = _single(0.62)
    missing = content["lost"]
    least, rest = missing["smallest_worst"], missing["readings"]["rest"]
    edges = np.array([1.0, 1.25, 1.5, 2.0, 3.0, 4.5, 6.0]) * least["worst_mm"]
    filled = axes.contourf(permittivity, alpha, worst.T, levels=edges, cmap=style.COLOURS,
                           extend="max")
    axes.contour(permittivity, alpha, worst.T, levels=[2 * least["worst_mm"]], colors="white",
                 linewidths=1.2)
    for point, marker, words in ((least, "o", "smallest worst misfit"),
                                 (rest, "x", "least squares")):
        axes.plot(point["relative_permittivity"], point["alpha_1"][0], marker, color="white",
                  markersize=4.5, label=words)
    axes.legend(loc="upper left", labelcolor="black")
    bar = figure.colorbar(filled, ax=axes, pad=0.02)
    bar.ax.yaxis.set_major_formatter("{x:.2f}")
    bar.set_label("worst misfit of the six ranges (mm)")
    axes.set(xlabel="relative permittivity", ylabel="α₁ (circle with the short semi-axis)")
    return figure


#: Every figure by its file's name.
FIGURES: dict[str, Callable[[Content, Curves], Figure]] = {
    "fig7": partial(_static, mass=MASSES[0]), "fig8": partial(_static, mass=MASSES[1]),
    "fig9": partial(_step, mass=MASSES[0]), "fig10": partial(_step, mass=MASSES[0], end=ZOOM),
    "fig11": partial(_step, mass=MASSES[1]), "fig12": partial(_step, mass=MASSES[1], end=ZOOM),
    "fig13": _loops, "fig14": _random, "misfit": _misfit,
}


def _ranges(content: Content, mass: float, name: str) -> dict[str, Any]:
    """List the ranges under a mass [kg] of an actuator, ours and the paper's."""
    row: dict[str, Any] = next(row for row in content["table_2"]["rows"]
                               if abs(row["mass_g"] - 1e3 * mass) < 1e-6
                               and row["specimen"] == name)
    return row


def _three(curves: Mapping[tuple[str, ...], Array], mass: float
           ) -> list[tuple[str, str, Array]]:
    return [(style.PALETTE[number], name, curves[f"{1e3 * mass:g}", name])
            for number, name in enumerate(NAMES)]


def _single(share: float = 0.75) -> tuple[Figure, Axes]:
    figure = style.new_figure(style.TITLE + _HEIGHT + style.AXIS, share * style.WIDTH)
    width = share * style.WIDTH - style.LEFT - style.RIGHT
    return figure, style.place_axes(figure, style.LEFT, style.TITLE, width, _HEIGHT)
