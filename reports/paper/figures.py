"""The paper's figures 7 to 14 in its axes, from what ``tympan lumped paper`` stored."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.reports import look as style
from tympan.studies.paper.published import MASSES, NAMES, SETTLING, SINES, STEP
from tympan.studies.replica.figures import ZOOM

Array = NDArray[np.float64]
Key = tuple[str, ...]

_LEFT, _RIGHT, _TOP, _AXIS, _HEIGHT = 14.0, 4.0, 6.0, 12.0, 70.0  # [mm]


@dataclass(frozen=True)
class PaperCurves:
    """The CSV files of a replica's folder: two columns by what the columns before them say."""

    folder: Path

    def read(self, name: str, keys: int) -> dict[Key, tuple[Array, Array]]:
        """Columns behind the first ``keys``, by these.

        Raises
        ------
        InputError
            When the file is missing or damaged.
        """
        file = self.folder / f"{name}.csv"
        pairs: dict[Key, list[tuple[float, float]]] = {}
        try:
            with file.open(encoding="utf-8", newline="") as stream:
                rows = csv.reader(stream)
                next(rows)
                for row in rows:
                    first, second = row[keys:keys + 2]
                    values = float(first), float(second or "nan")
                    pairs.setdefault(tuple(row[:keys]), []).append(values)
        except (OSError, ValueError, StopIteration) as error:
            raise InputError(f"cannot be read: {error}; run tympan lumped paper again",
                             file=file) from None
        columns = {key: np.array(values).T for key, values in pairs.items()}
        return {key: (both[0], both[1]) for key, both in columns.items()}

    @cached_property
    def content(self) -> dict[str, Any]:
        """What paper.json holds."""
        return read_paper(self.folder)

    def row(self, mass: float, name: str) -> dict[str, Any]:
        """Ranges under a mass [kg] of an actuator, ours and the paper's."""
        return next(row for row in self.content["table_2"]["rows"]
                    if abs(row["mass_g"] - 1e3 * mass) < 1e-6 and row["specimen"] == name)

    @cached_property
    def steps(self) -> dict[Key, tuple[Array, Array]]:
        """Responses to the step."""
        return self.read("step", 2)


def read_paper(folder: Path) -> dict[str, Any]:
    """What paper.json holds."""
    file = folder / "paper.json"
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        if not {"lost", "chosen", "table_2", "settling", "hysteresis", "findings"} <= set(content):
            raise ValueError("something is missing")
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"cannot be read: {error}; run tympan lumped paper again",
                         file=file) from None
    return dict(content)


def draw_paper(folder: Path) -> list[Path]:
    """Draw folder/fig7 … fig14 and folder/misfit; answers the files."""
    curves = PaperCurves(folder)
    return [file for name, compose in FIGURES.items()
            for file in style.save_figure(folder, name, partial(compose, curves))]


def _static(mass: float) -> Callable[[PaperCurves], Figure]:
    def make(curves: PaperCurves) -> Figure:
        figure, axes = _single()
        for colour, name, (volts, y) in _three(curves.read("static", 2), mass):
            row = curves.row(mass, name)
            axes.plot(volts, y, color=colour,
                      label=f"{name}: range {row['at_rest_mm']:.2f} mm (paper, over steps: "
                            f"{row['paper_mm']:.2f} mm)")
        return _finish(figure, axes, "voltage (kV)")

    return make


def _step(mass: float, zoom: bool) -> Callable[[PaperCurves], Figure]:
    def make(curves: PaperCurves) -> Figure:
        figure, axes = _single()
        end = ZOOM if zoom else np.inf
        for colour, name, (time, y) in _three(curves.steps, mass):
            kept = time <= end
            settled = SETTLING[MASSES.index(mass), NAMES.index(name)]
            ours = curves.content["settling"]["rows"][0][f"{name}_{1e3 * mass:g}g_s"]
            axes.plot(time[kept], y[kept], color=colour, linewidth=0.8,
                      label=f"{name}: {ours:.2f} s (paper: {settled:.2f} s)" if zoom else name)
            if zoom:
                for at, marker in ((ours, "o"), (settled, "v")):
                    axes.plot(at, np.interp(at, time, y), marker, color=colour,
                              markeredgecolor="black", markersize=5,
                              markeredgewidth=0.6)
        axes.set_xlim(0, end if zoom else None)
        axes.set_ylim(top=axes.get_ylim()[1] + 0.25 * np.ptp(axes.get_ylim()))
        axes.set_title(f"step {STEP[0] / 1e3:g} to {STEP[1] / 1e3:g} kV at 0 s, {1e3 * mass:g} g"
                       + (", settled: ○ within 5 % of the largest swing, ▽ paper" if zoom else ""),
                       loc="left")
        return _finish(figure, axes, "time (s)")

    return make


def _loops(curves: PaperCurves) -> Figure:
    loops = curves.read("hysteresis", 3)
    height, gap, margin = 42.0, 11.0, 16.0
    figure = style.new_figure(_TOP + 3 * (height + gap))
    width = style.WIDTH / 2 - margin - _RIGHT
    for row, name in enumerate(NAMES):
        for column, (offset, amplitude) in enumerate(SINES):
            axes = style.place_axes(figure, margin + column * style.WIDTH / 2,
                                    _TOP + row * (height + gap), width, height)
            volts, y = loops[f"{offset / 1e3:g}", f"{amplitude / 1e3:g}", name]
            axes.plot(np.append(volts, volts[0]), np.append(y, y[0]), color=style.PALETTE[row])
            letter = "abcdef"[2 * row + column]
            axes.set_title(f"({letter}) {name}, u₀ = {offset / 1e3:g} kV, u₁ = {amplitude / 1e3:g} "
                           "kV", loc="left")
            axes.locator_params(axis="x", nbins=8)
            style.faint_grid(axes)
            axes.set_xlabel("voltage (kV)" if row == 2 else "")
            axes.set_ylabel("distance (mm)" if column == 0 else "")
    return figure


def _random(curves: PaperCurves) -> Figure:
    traces, ((time, volts),) = curves.read("random", 2), curves.read("signal", 0).values()
    heights = (26.0, 48.0, 48.0)
    figure = style.new_figure(sum(heights) + 3 * (_TOP + 2) + _AXIS - 2)
    top = _TOP
    for number, height in enumerate(heights):
        axes = style.place_axes(figure, _LEFT, top, style.WIDTH - _LEFT - _RIGHT, height)
        top += height + _TOP + 2
        if number == 0:
            axes.plot(time, volts, color="black", linewidth=0.8)
            axes.set_title("(a) applied voltage", loc="left")
            axes.set_ylabel("voltage (kV)")
        else:
            mass = MASSES[number - 1]
            for colour, name, (at, y) in _three(traces, mass):
                row = curves.row(mass, name)
                axes.plot(at, y, color=colour, linewidth=0.7,
                          label=f"{name} {row['at_levels_mm']:.2f} mm (paper "
                                f"{row['paper_mm']:.2f})")
            axes.set_title(f"({'abc'[number]}) {1e3 * mass:g} g, ranges at the ends of the levels",
                           loc="left")
            axes.set_ylabel("distance (mm)")
            axes.set_ylim(top=axes.get_ylim()[1] + 0.14 * np.ptp(axes.get_ylim()))
            axes.legend(loc="upper right", ncols=3, handlelength=1.2, columnspacing=1.0)
        axes.set_xlim(0, time[-1])
        axes.tick_params(labelbottom=number == 2)
        style.faint_grid(axes)
    axes.set_xlabel("time (s)")
    return figure


def _misfit(curves: PaperCurves) -> Figure:
    columns = curves.read("misfit", 1)
    permittivity = np.array([float(key) for (key,) in columns])
    alpha = next(iter(columns.values()))[0]
    worst = np.array([pair[1] for pair in columns.values()])
    figure, axes = _single(0.62)
    missing = curves.content["lost"]
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
    axes.set_xlabel("relative permittivity")
    axes.set_ylabel("α₁ (circle with the short semi-axis)")
    return figure


#: Every figure by its file's name.
FIGURES: dict[str, Callable[[PaperCurves], Figure]] = {
    "fig7": _static(MASSES[0]), "fig8": _static(MASSES[1]), "fig9": _step(MASSES[0], False),
    "fig10": _step(MASSES[0], True), "fig11": _step(MASSES[1], False),
    "fig12": _step(MASSES[1], True),
    "fig13": _loops, "fig14": _random, "misfit": _misfit,
}


def _three(found: dict[Key, tuple[Array, Array]],
           mass: float) -> list[tuple[str, str, tuple[Array, Array]]]:
    return [(style.PALETTE[number], name, found[f"{1e3 * mass:g}", name])
            for number, name in enumerate(NAMES)]


def _single(share: float = 0.75) -> tuple[Figure, Axes]:
    figure = style.new_figure(_TOP + _HEIGHT + _AXIS, share * style.WIDTH)
    width = share * style.WIDTH - _LEFT - _RIGHT
    return figure, style.place_axes(figure, _LEFT, _TOP, width, _HEIGHT)


def _finish(figure: Figure, axes: Axes, across: str) -> Figure:
    axes.set_xlabel(across)
    axes.set_ylabel("distance (mm)")
    axes.legend(loc="upper left" if "voltage" in across else "upper right")
    style.faint_grid(axes)
    return figure
