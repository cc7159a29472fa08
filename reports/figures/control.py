"""Closed loops: voltage and deflection in time, compared with the same film without feedback."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.lumped.control.result import ControlledFilm, ControlResult

#: Height of the axis of the voltage [mm].
_VOLTAGE = 22.0
#: Height of the axis of the deflection [mm].
_DEFLECTION = 50.0


def draw_control(result: ControlResult, folder: Path) -> list[Path]:
    """Draw folder/control; return the files."""
    return style.save_figure(folder, "control", lambda: _compose(result))


def _compose(result: ControlResult) -> Figure:
    figure, columns = style.pairs(len(result.films), _VOLTAGE, _DEFLECTION)
    for number, ((above, below), film) in enumerate(zip(columns, result.films, strict=True)):
        draw_voltages(above, film)
        draw_deflections(below, film)
        style.describe(above, "", "" if number else "voltage (kV)",
                       f"{film.specimen}, {1e3 * film.mass_kg:g} g")
        style.describe(below, "time (s)", "" if number else "deflection (mm)")
        if not number:
            style.legend(below)
    return figure


def draw_voltages(axes: Axes, film: ControlledFilm) -> None:
    """Draw the voltage with and without feedback."""
    samples = film.samples
    axes.plot(samples["t"], 1e-3 * samples["open_voltage"], color=style.GREY, linewidth=0.8)
    axes.plot(samples["t"], 1e-3 * samples["voltage"], color=style.colour_of(0), linewidth=0.8)


def draw_deflections(axes: Axes, film: ControlledFilm) -> None:
    """Draw the wanted deflection, and those with and without feedback."""
    samples = film.samples
    for name, words, colour, line in (
            ("open_displacement", "without feedback", style.GREY, "-"),
            ("displacement", "with feedback", style.colour_of(0), "-"),
            ("wanted", "wanted", "black", "--")):
        axes.plot(samples["t"], 1e3 * samples[name], line, color=colour, linewidth=0.8,
                  label=words)
