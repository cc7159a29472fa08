"""A steered plate: the path of its normal by each way of driving it, and the segments' voltages."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.lumped.steered.result import SteeredResult

#: Size of the plane of tilts [mm].
_PLANE = 74.0
#: Width of the axis of voltages [mm], and of the gap before it.
_VOLTAGES = 78.0
_GAP = 16.0
#: Height above for the titles [mm].
_TOP = 8.0
#: Half width of the plane over the largest tilt, and room for the legend over it.
_BEYOND = 1.08
_ROOM = 0.12
#: Words and colours of the runs; the one with feedback is drawn last.
_RUNS = (("static", "static inverse", style.GREY),
         ("motion", "motion fed forward", style.PALETTE[1]),
         ("feedback", "with feedback", style.PALETTE[0]))


def draw_steered(result: SteeredResult, folder: Path) -> list[Path]:
    """Draw folder/NAME-steered.png and .svg; return the files."""
    return style.save_figure(folder, f"{result.specimen}-steered", lambda: _compose(result))


def _compose(result: SteeredResult) -> Figure:
    width = style.LEFT + _PLANE + _GAP + _VOLTAGES + style.RIGHT
    figure = style.new_figure(_TOP + _PLANE + style.AXIS, width)
    plane = style.place_axes(figure, style.LEFT, _TOP, _PLANE, _PLANE)
    beside = style.place_axes(figure, style.LEFT + _PLANE + _GAP, _TOP, _VOLTAGES, _PLANE)
    draw_normal(plane, result)
    style.describe(plane, "tilt along x (mrad)", "tilt along y (mrad)", "path of the normal",
                   bold=True)
    _draw_voltages(beside, result)
    style.describe(beside, "time (s)", "voltage (kV)", "voltages with feedback", bold=True)
    style.legend(beside)
    return figure


def draw_normal(axes: Axes, result: SteeredResult) -> None:
    """Draw the tilts of the runs, and the wanted ones."""
    samples = result.samples
    for drive, words, colour in _RUNS:
        axes.plot(1e3 * samples[f"{drive}_tilt_x"], 1e3 * samples[f"{drive}_tilt_y"], color=colour,
                  linewidth=0.8, label=words)
    axes.plot(1e3 * samples["wanted_tilt_x"], 1e3 * samples["wanted_tilt_y"], "--", color="black",
              linewidth=0.8, label="wanted")
    reach = _BEYOND * 1e3 * max(abs(samples[f"{name}_tilt_{along}"]).max() for along in "xy"
                                for name in ("wanted", *(drive for drive, *_ in _RUNS)))
    # The plane is square, with room for the legend above the path.
    axes.set(xlim=(-(1 + _ROOM) * reach, (1 + _ROOM) * reach),
             ylim=(-reach, (1 + 2 * _ROOM) * reach), aspect="equal")
    axes.legend(loc="upper left", ncols=2)


def _draw_voltages(axes: Axes, result: SteeredResult) -> None:
    samples = result.samples
    colours = style.segment_colours(len(result.segments))
    for name, colour in zip(result.segments, colours, strict=True):
        axes.plot(samples["t"], 1e-3 * samples[f"feedback_voltage_{name}"], color=colour,
                  linewidth=0.8, drawstyle="steps-post", label=name)
