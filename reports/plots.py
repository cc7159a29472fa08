"""One plain picture of each kind of result, on matplotlib's axes or in a file."""

from __future__ import annotations

import os
from functools import partial, singledispatch
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.tri import Triangulation

from tympan.base.errors import InputError
from tympan.base.toml_reader import one_of
from tympan.geometry.specimen import Specimen
from tympan.reports import look
from tympan.reports.diagnosis.page import cause_label
from tympan.reports.figures.control import draw_deflections
from tympan.reports.figures.coupon import draw_laws
from tympan.reports.figures.curve import (
    draw_curve,
    draw_voltage_curves,
    frame_curves,
    voltage_curves,
)
from tympan.reports.figures.design import draw_bounds
from tympan.reports.figures.force import draw_force_curves
from tympan.reports.figures.path import draw_stations
from tympan.reports.figures.sense import draw_capacitance
from tympan.reports.figures.specimen import draw_to_scale, segment_handles, segment_words
from tympan.reports.figures.steer import draw_reach
from tympan.reports.figures.steered import draw_normal
from tympan.reports.figures.tolerance import draw_histogram
from tympan.reports.sweep.figure import draw_over
from tympan.reports.sweep.view import SweepView
from tympan.reports.template import percent
from tympan.studies.alpha import AlphaResult
from tympan.studies.case import CaseResult
from tympan.studies.design.result import DesignResult
from tympan.studies.diagnosis.film_fit import FilmFit
from tympan.studies.diagnosis.result import Diagnosis
from tympan.studies.files import write_atomically
from tympan.studies.film_surface import FilmSurface
from tympan.studies.force import ForceResult
from tympan.studies.limits import LimitsResult
from tympan.studies.limits.curve import CurveResult
from tympan.studies.lumped.build import BuildResult
from tympan.studies.lumped.control.result import ControlResult
from tympan.studies.lumped.steered.result import SteeredResult
from tympan.studies.material.result import MaterialFitResult
from tympan.studies.modes import ModesResult
from tympan.studies.path import PathResult
from tympan.studies.response import ResponseResult
from tympan.studies.sense import SenseResult
from tympan.studies.sensitivity import SensitivityResult
from tympan.studies.steer import SteerResult
from tympan.studies.study import StudyResult
from tympan.studies.sweep.run import SweepResult
from tympan.studies.sweep.table import column_name, frame
from tympan.studies.tolerance.result import ToleranceResult
from tympan.studies.trace import Responses

#: Height of a picture in a file [mm].
_HEIGHT = 75.0
#: Width of a picture in a file [mm].
_WIDTH = 100.0

#: Resolution of a picture in a notebook's answer [dpi]; a finer one is `plot()`.
_SMALL = 100

_SHOWN = 12  #: bars of a chart of sensitivities

#: Distance of the line around a segment from its edge, over the frame: neighbours do not coincide.
_INSET = 0.006


def plot(result: object, target: Axes | str | os.PathLike[str] | None = None, **choices: Any
         ) -> Axes:
    """Draw a result on axes, into a file, or where nothing is given on new axes of pyplot.

    Parameters
    ----------
    target
        Axes, or a file of any kind matplotlib writes; modes, and films in time, move in NAME.gif.
    choices
        For a sweep: the result ``of`` which a map is drawn, the two keys ``over`` which, and the
        voltage ``at`` which, by default the highest.

    Raises
    ------
    InputError
        When there is nothing to draw, or the file's kind is not known.
    """
    if isinstance(target, Axes):
        draw(result, target, **choices)
        return target
    if target is None:
        return _shown(result, choices)
    file = Path(target)
    with look.figure_style():
        figure = look.new_figure(_HEIGHT, _WIDTH)
        moves = file.suffix == ".gif" and isinstance(result, ModesResult | Responses)
        if not moves and file.suffix[1:] not in figure.canvas.get_supported_filetypes():
            raise InputError("must end in .png, .svg or .pdf, or, of modes and of films in time, "
                             "in .gif", key="file", given=str(file))
        axes = figure.add_subplot()
        draw(result, axes, **choices)
        figure.tight_layout()
        if moves:
            _animate(result, file)
        else:
            write_atomically(file, partial(figure.savefig, dpi=look.DPI))
    return axes


def png(result: object) -> bytes | None:
    """Draw a small picture of a result; None where there is nothing to draw."""
    with look.figure_style():
        figure = look.new_figure(_HEIGHT, _WIDTH)
        try:
            draw(result, figure.add_subplot())
        except InputError:
            return None
        figure.tight_layout()
        content = BytesIO()
        figure.savefig(content, format="png", dpi=_SMALL)
    return content.getvalue()


def _animate(result: object, file: Path) -> None:
    """Animate a result: modes oscillate, a film moves through the requested moments."""
    from tympan.reports.figures import animation, modes

    if isinstance(result, ModesResult):
        modes.animate_modes(result, file)
    elif isinstance(result, Responses):
        if not result.films[0]:
            raise InputError("there is no film to draw: ask for it at some times, films=[...]")
        animation.animate(result.responses[0], result.films[0], file)


def _shown(result: object, choices: dict[str, Any]) -> Axes:
    """Draw on pyplot's axes, which notebooks and ``pyplot.show()`` show."""
    from matplotlib import pyplot

    # Before the style is set: a notebook's settings as it starts to draw would be reset with it.
    figure = pyplot.figure(figsize=(1.3 * _WIDTH * look.MM, 1.3 * _HEIGHT * look.MM), dpi=150)
    with look.figure_style():
        axes: Axes = figure.add_subplot()
        try:
            draw(result, axes, **choices)
        except BaseException:
            pyplot.close(figure)
            raise
        figure.tight_layout()
    return axes


@singledispatch
def draw(result: object, axes: Axes) -> None:
    """Draw one kind of result; each kind registers its own."""
    raise InputError(f"there is no picture of {type(result).__name__}: see result.to_pandas()")


@draw.register
def _(specimen: Specimen, axes: Axes, voltage: float | None = None) -> None:
    draw_to_scale(specimen, axes)
    axes.set_title(specimen.name, weight="bold")
    if specimen.electrode.segments:
        axes.legend(handles=segment_handles(segment_words(specimen, voltage)), ncols=2,
                    loc="upper center", bbox_to_anchor=(0.5, -0.1))


@draw.register
def _(result: CaseResult, axes: Axes) -> None:
    film = _film(result.film, result.warnings)
    _map(axes, film, film.values["stress_1"] / 1e3, "largest true stress (kPa)")
    hatched = "\nhatched: wrinkled or slack" if _hatch_slack(axes, film) else ""
    if result.segments:
        voltages = {each.name: f"{each.voltage_V / 1e3:.4g} kV" for each in result.segments}
        axes.legend(handles=segment_handles(voltages), ncols=min(4, len(voltages)),
                    loc="upper center", bbox_to_anchor=(0.5, -0.16), handlelength=1.2)
    axes.set_title(f"{result.specimen}: {1e3 * result.mass_kg:.4g} g, "
                   f"{1e-3 * result.voltage_V:.4g} kV, deflection "
                   f"{1e3 * (result.deflection_m or 0.0):.4g} mm{hatched}")


@draw.register
def _(result: ModesResult, axes: Axes) -> None:
    film = _film(result.film, result.warnings)
    _map(axes, film, film.values["mode_1"][:, 2], "motion along the load, relative")
    axes.set_title(f"{result.specimen}: {result.modes[0].name}, {result.modes[0].speed}")


@draw.register
def _(result: LimitsResult, axes: Axes) -> None:
    reached = result.limits.told
    if not reached:
        raise InputError(f"there is nothing to draw: no limit up to {result.limits.ended}")
    axes.barh([limit.state.label for limit in reached],
              [limit.voltage_V / 1e3 for limit in reached], color=look.PALETTE[0])
    axes.invert_yaxis()
    axes.set(xlabel="voltage (kV)", title=f"{result.specimen}: {1e3 * result.mass_kg:.4g} g")


@draw.register
def _(result: ResponseResult, axes: Axes) -> None:
    if not result.frequency_Hz:
        raise InputError(f"there is nothing to draw: {'; '.join(result.warnings)}")
    axes.loglog(result.frequency_Hz, 1e9 * np.array(result.amplitude_m_per_V))
    axes.set(xlabel="frequency (Hz)", ylabel="amplitude (µm/kV)",
             title=f"{result.specimen}: {1e3 * result.mass_kg:.4g} g, "
                   f"{result.voltage_V / 1e3:.4g} kV")


@draw.register
def _(result: PathResult, axes: Axes) -> None:
    draw_stations(axes, result)
    look.legend(axes)


@draw.register
def _(result: Responses, axes: Axes) -> None:
    for number, response in enumerate(result.responses):
        samples = response.samples
        axes.plot(samples["t"], 1e3 * samples["displacement"], color=look.colour_of(number),
                  label=f"{response.specimen}, {1e3 * response.mass_kg:.4g} g")
    first = result.responses[0]  # all have one signal
    voltages = 1e-3 * np.append(first.samples["voltage"], first.first_voltage_V)
    axes.set(xlabel="time (s)", ylabel="displacement read (mm)",
             title=f"voltage between {voltages.min():.4g} and {voltages.max():.4g} kV")
    look.legend(axes)


@draw.register
def _(result: ControlResult, axes: Axes) -> None:
    film = result.films[0]
    draw_deflections(axes, film)
    axes.set(xlabel="time (s)", ylabel="displacement (mm)",
             title=f"{film.specimen}: {1e3 * film.mass_kg:.4g} g")
    look.legend(axes)


@draw.register
def _(result: SensitivityResult, axes: Axes) -> None:
    if not result.quantities:
        raise InputError(f"there is nothing to draw: {'; '.join(result.warnings)}")
    quantity, first = next(iter(result.quantities.items()))
    bars = sorted(((answer.elasticity, parameter) for parameter, answer in first.by.items()
                   if answer.elasticity), key=lambda bar: abs(bar[0]))[-_SHOWN:]
    axes.barh([name for _, name in bars], [size for size, _ in bars], color=look.PALETTE[0])
    axes.set(xlabel=f"change of {quantity} (%) by 1 % more", title=result.specimen)


@draw.register
def _(result: AlphaResult, axes: Axes) -> None:
    weights, place = result.by_basis["membrane"], np.arange(len(result.circles))
    axes.bar(place, weights.alpha, 0.5, color=look.PALETTE[0])
    axes.set_xticks(place, [f"{1e3 * radius:.4g}" for radius in result.circles])
    axes.set(xlabel="radius of the circle (mm)", ylabel="α",
             title=f"{result.specimen}: force error {percent(weights.fit_error)}")


@draw.register
def _(result: SweepResult, axes: Axes, of: str = "deflection_m",
      over: tuple[str, str] | None = None, voltage: float | str | None = None) -> None:
    if over is not None:
        draw_over(SweepView(result, voltage), axes, of, over)
        return
    table = result.table
    along = [column_name(table, str(axis)) for axis in table["status"].dims if axis != "voltage"]
    lines = list(frame(table).groupby(along, sort=False, dropna=False))
    for number, (_, line) in enumerate(lines):
        _curve(axes, number, line["voltage_V"], line["deflection_m"], line["specimen"].iloc[0],
               line["mass_kg"].iloc[0])
    axes.set(xlabel="voltage (kV)", ylabel="deflection (mm)")
    if len(lines) <= _SHOWN:
        look.legend(axes)


@draw.register
def _(result: StudyResult, axes: Axes) -> None:
    curves = [(number, specimen.name, curve) for number, specimen in enumerate(result.specimens)
              for curve in voltage_curves(specimen.curves)]
    for number, name, curve in curves:
        draw_curve(axes, curve, number, curve.named(name, f"{curve.mass:g} g"),
                   len(result.specimens))
    axes.set(xlabel="voltage (kV)", ylabel="deflection (mm)", title=result.name)
    frame_curves(axes, [curve for *_, curve in curves])


@draw.register
def _(result: CurveResult, axes: Axes) -> None:
    draw_voltage_curves(axes, result)


@draw.register
def _(result: ForceResult, axes: Axes) -> None:
    draw_force_curves(axes, result)


@draw.register
def _(result: SenseResult, axes: Axes) -> None:
    draw_capacitance(axes, result)


@draw.register
def _(result: SteerResult, axes: Axes) -> None:
    draw_reach(axes, result)


@draw.register
def _(result: SteeredResult, axes: Axes) -> None:
    draw_normal(axes, result)
    look.describe(axes, "tilt along x (mrad)", "tilt along y (mrad)")


@draw.register
def _(result: ToleranceResult, axes: Axes, of: str = "deflection_m") -> None:
    if of not in result.quantities:
        raise InputError(one_of(of, result.quantities), key="of", given=of)
    draw_histogram(axes, of, result.quantities[of])


def _curve(axes: Axes, number: int, voltage: Any, deflection: Any, specimen: str, mass: float
           ) -> None:
    axes.plot(1e-3 * voltage, 1e3 * deflection, f"{look.marker_of(number)}-", markersize=3,
              color=look.colour_of(number), label=f"{specimen}, {1e3 * mass:.4g} g")


@draw.register
def _(result: BuildResult, axes: Axes) -> None:
    ramps = result.statics.groupby(["specimen", "mass"], sort=False)
    for number, ((name, mass), ramp) in enumerate(ramps):
        for kinematics, line in {"field": "o", "membrane": "-"}.items():
            axes.plot(1e-3 * ramp["voltage"], ramp[f"{kinematics}_mm"], line,
                      color=look.colour_of(number), markersize=3,
                      label=f"{name}, {1e3 * mass:.4g} g, {kinematics}")
    axes.set(xlabel="voltage (kV)", ylabel="deflection (mm)")
    look.legend(axes)


@draw.register
def _(result: Diagnosis, axes: Axes) -> None:
    causes = result.causes[::-1]
    axes.barh([cause_label(cause).replace("_", " ") for cause in causes],
              [cause.probability for cause in causes], color=look.PALETTE[0])
    axes.set(xlabel="probability", xlim=(0, 1), title=f"verdict: {result.verdict}")


@draw.register
def _(result: MaterialFitResult, axes: Axes) -> None:
    draw_laws(axes, result)


@draw.register
def _(result: FilmFit, axes: Axes) -> None:
    constants = result.constants[::-1]
    for number, (_, _, size) in enumerate(constants):
        limits = [size.low or 0.0, size.high or size.value]
        axes.plot(np.array(limits) / size.value, [number] * 2, color=look.PALETTE[0])
        axes.plot(1.0, number, "o", color=look.PALETTE[0])
    axes.set_yticks(range(len(constants)), [f"{name}\n{size.value:.4g} {unit}".strip()
                                            for name, unit, size in constants])
    axes.set(xlabel="95 % limits over the fitted value", title=result.dataset,
             ylim=(-0.5, len(constants) - 0.5))
    axes.locator_params(axis="x", nbins=5)


@draw.register
def _(result: DesignResult, axes: Axes) -> None:
    draw_bounds(axes, result, result.films[0])


def _hatch_slack(axes: Axes, film: FilmSurface) -> bool:
    """Hatch where the film has lost tension; return whether it has."""
    loose = film.values["tension"]
    if loose.max() > 0:
        x, y, _ = 1e3 * film.mounted.T
        limits = axes.axis()
        axes.tricontourf(Triangulation(x, y, film.triangles), loose, [0.5, 2.5], colors="none",
                         hatches=["////"])
        axes.axis(limits)
    return bool(loose.max() > 0)


def _film(film: FilmSurface | None, warnings: tuple[str, ...]) -> FilmSurface:
    if film is None:
        raise InputError(f"there is no film to draw: {'; '.join(warnings)}")
    return film


def _map(axes: Axes, film: FilmSurface, values: np.ndarray, words: str) -> None:
    """Draw values over the flat mounted film, seen along the load."""
    x, y, _ = 1e3 * film.mounted.T
    drawn = axes.tripcolor(Triangulation(x, y, film.triangles), values, shading="gouraud",
                           cmap=look.COLOURS, rasterized=True)
    figure = axes.get_figure()
    assert figure is not None
    figure.colorbar(drawn, ax=axes, label=words)
    for number, colour in enumerate(look.segment_colours(film.segments)):
        lines = film.flat.segment_edges(number, _INSET * np.abs(film.mounted).max())
        axes.add_collection(LineCollection(list(1e3 * lines[:, :, :2]), colors=colour,
                                           linewidths=1.5))
    axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
