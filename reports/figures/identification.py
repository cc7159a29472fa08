"""What readings determine of a model's constants: profiles of the likelihood, and correlations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.reports.figures.response import grid
from tympan.studies.estimation.identifiability import Judgement
from tympan.studies.estimation.profile import Profile
from tympan.studies.identify.dynamic_search import DynamicFit
from tympan.studies.identify.responses import Record
from tympan.studies.identify.static_search import StaticFit

_LEFT, _RIGHT, _TOP, _BOTTOM = 14.0, 4.0, 8.0, 13.0  # [mm]
_TITLE, _AXIS, _GAP, _VOLTAGE, _RESPONSE = 6.0, 12.0, 5.0, 22.0, 60.0
_WHOLE, _LEFTOVER, _POINTS = 45.0, 18.0, 5000
_BEGINNING = 30.0  # radians of the fast oscillation that are shown on their own
_SYMBOLS = {"relative_permittivity": "ε$_r$", "alpha_1": "α₁", "beta_1": "β₁", "beta_2": "β₂",
            "beta_3": "β₃",
            "gamma_1": "γ₁", "gamma_2": "γ₂", "gamma_3": "γ₃", "k_1": "k₁", "eta_1": "η₁",
            "eta_2": "η₂"}
_PANEL, _COLUMNS, _CELL, _BAR, _SHORTEST, _LETTER, _NARROWEST = 38.0, 3, 11.0, 20.0, 6.0, 1.3, 75.0


def draw_static(fit: StaticFit, folder: Path,
                formats: Sequence[str] = ("png", "svg")) -> list[Path]:
    """Draw folder/static: what was read and the fit, above; what is left, below; a column for each mass."""
    style.check(formats)
    with style.look():
        return style.save(_static(fit), folder, "static", formats)


def draw_dynamic(fit: DynamicFit, folder: Path,
                 formats: Sequence[str] = ("png", "svg")) -> list[Path]:
    """Draw folder/dynamic: a row for each mass; what was read and the fit, their beginning, and what is left."""
    style.check(formats)
    with style.look():
        return style.save(_dynamic(fit), folder, "dynamic", formats)


def draw_profiles(judgement: Judgement, folder: Path, name: str = "profiles",
                  formats: Sequence[str] = ("png", "svg")
                  ) -> list[Path]:
    """Draw folder/name: of each constant that has one, √Δχ² over its value, with the 95 % limits.

    A straight V is a linear problem; a branch that never meets the dotted line leaves its side
    open.
    """
    style.check(formats)
    with style.look():
        return style.save(_profiles(judgement), folder, name, formats)


def draw_correlations(judgement: Judgement, folder: Path, name: str = "correlations",
                      formats: Sequence[str] = ("png", "svg")) -> list[Path]:
    """Draw folder/name: the linearised correlations of the constants, those not determined in grey."""
    style.check(formats)
    with style.look():
        return style.save(_correlations(judgement), folder, name, formats)


def _symbol(name: str) -> str:
    """As the paper writes it; of an α with the shape it belongs to."""
    plain, _, shape = name.partition("[")
    return _SYMBOLS.get(plain, plain) + (f" ({shape[:-1]})" if shape else "")


def _static(fit: StaticFit) -> Figure:
    readings = fit.problem.readings
    left = fit.problem.residual(fit.values, "deflection")[0]
    masses = np.unique(readings.mass)
    figure = style.page(_TITLE + _RESPONSE + _GAP + _VOLTAGE + _AXIS)
    width = (style.WIDTH - _RIGHT) / len(masses) - _LEFT
    for column, mass in enumerate(masses):
        start = _LEFT + column * (width + _LEFT)
        above = style.place(figure, start, _TITLE, width, _RESPONSE)
        below = style.place(figure, start, _TITLE + _RESPONSE + _GAP, width, _VOLTAGE)
        for number, specimen in enumerate(readings.specimens):
            own = np.flatnonzero((readings.which == number) & (readings.mass == mass))
            own = own[np.argsort(readings.voltage[own])]
            colour = style.PALETTE[number % len(style.PALETTE)]
            volts, at = 1e-3 * readings.voltage[own], fit.problem.read[own]
            above.plot(volts, 1e3 * at, "o", color=colour, markersize=3, markerfacecolor="none",
                       label=specimen.name)
            above.plot(volts, 1e3 * (at + left[own]), color=colour, linewidth=0.8)
            below.plot(volts, 1e6 * left[own], "o-", color=colour, markersize=2, linewidth=0.5)
        above.set_title(f"{1e3 * mass:g} g", weight="bold", loc="left")
        above.legend(loc="upper left")
        above.tick_params(labelbottom=False)
        below.set_xlabel("voltage (kV)")
        if column == 0:
            above.set_ylabel("displacement (mm)")
            below.set_ylabel("fit − read (µm)")
        for axes in (above, below):
            grid(axes)
    return figure


def _dynamic(fit: DynamicFit) -> Figure:
    records, parts = fit.problem.records, fit.problem.parts(fit.z)
    masses = sorted({record.mass for record in records})
    numbers = sorted({record.specimen for record in records})
    height = _WHOLE + _GAP + _LEFTOVER
    figure = style.page(len(masses) * (_TITLE + height + _AXIS))
    width = style.WIDTH / 2 - _LEFT - _RIGHT
    for row, mass in enumerate(masses):
        top = _TITLE + row * (_TITLE + height + _AXIS)
        columns = [(style.place(figure, left, top, width, _WHOLE),
                    style.place(figure, left, top + _WHOLE + _GAP, width, _LEFTOVER))
                   for left in (_LEFT, style.WIDTH / 2 + _LEFT)]
        for record, (residual, _) in zip(records, parts, strict=True):
            if record.mass == mass:
                colour = style.PALETTE[numbers.index(record.specimen) % len(style.PALETTE)]
                name = fit.problem.actuator(record, fit.z).specimen.name
                for (above, below), end in zip(columns, (np.inf, _BEGINNING * fit.fast),
                                               strict=True):
                    _response(above, below, record, residual, end, colour, name)
        for above, below in columns:
            above.tick_params(labelbottom=False)
            below.set_xlabel("time since the voltage changed (s)")
            for axes in (above, below):
                grid(axes)
        columns[0][0].set_title(f"{1e3 * mass:g} g", weight="bold", loc="left")
        columns[1][0].legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=len(numbers))
        columns[0][0].set_ylabel("displacement (mm)")
        columns[0][1].set_ylabel("fit − read (µm)")
    return figure


def _response(above: Axes, below: Axes, record: Record, residual: np.ndarray, end: float,
              colour: str, name: str
              ) -> None:
    """One run up to a time since its voltage changed, as dots read and a line fitted; the difference below."""
    since = record.time - record.begins
    inside = np.flatnonzero((since <= end) & (since >= -end / 5))
    inside = inside[np.unique(np.linspace(0, len(inside) - 1,
                                          min(len(inside), _POINTS)).astype(int))]
    at, read = since[inside], 1e3 * record.displacement[inside]
    above.plot(at, read, ".", color=colour, markersize=2, alpha=0.5, markeredgewidth=0,
               rasterized=True)
    above.plot(at, read + 1e3 * residual[inside], color=colour, linewidth=0.6, label=name)
    below.plot(at, 1e6 * residual[inside], ".", color=colour, markersize=1.5, markeredgewidth=0,
               rasterized=True)


def _profiles(judgement: Judgement) -> Figure:
    drawn = [(one, line) for one, line in zip(judgement.constants, judgement.profiles, strict=True)
             if line is not None]
    rows = max(1, -(-len(drawn) // _COLUMNS))
    figure = style.page(rows * (_TOP + _PANEL + _BOTTOM))
    width = style.WIDTH / _COLUMNS - _LEFT - _RIGHT
    if not drawn:
        figure.text(0.5, 0.5, "these data determine none of the constants", ha="center")
    for number, (one, line) in enumerate(drawn):
        row, column = divmod(number, _COLUMNS)
        axes = style.place(figure, _LEFT + column * (_LEFT + width + _RIGHT),
                           _TOP + row * (_TOP + _PANEL + _BOTTOM), width, _PANEL)
        at = np.array([judgement.to_value(one.name, value) for value in line.values])
        colour = style.PALETTE[0] if one.low is not None else style.PALETTE[1]
        axes.plot(at, np.abs(line.rise), "o-", color=colour, markersize=2.5, linewidth=0.8)
        axes.axhline(judgement.quantile, color="black", linewidth=0.6, linestyle=":")
        for end in (line.low, line.high):
            if end is not None:
                axes.axvline(judgement.to_value(one.name, end), color=colour, linewidth=0.6,
                             linestyle="--")
        axes.set_xlim(*_span(line, at))
        axes.set_ylim(0, 1.5 * judgement.quantile)
        axes.set_title(_symbol(one.name), loc="left", weight="bold")
        axes.set_xlabel("" if one.unit == "1" else f"({one.unit})")
        axes.ticklabel_format(axis="x", useOffset=False, scilimits=(-3, 5))
        axes.locator_params(axis="x", nbins=4)
        if column == 0:
            axes.set_ylabel("√(χ² − χ²min)")
    return figure


def _span(line: Profile, at: np.ndarray) -> tuple[float, float]:
    """A little more than the limits; than all that was tried where one is open."""
    inside = np.flatnonzero(np.abs(line.rise) <= 1.2 * np.abs(line.rise).max())
    low, high = float(at[inside].min()), float(at[inside].max())
    edge = 0.08 * (high - low or abs(low) or 1.0)
    return low - edge, high + edge


def _correlations(judgement: Judgement) -> Figure:
    names = [_symbol(one.name) for one in judgement.constants]
    sure = np.array([one.low is not None for one in judgement.constants])
    size = _CELL * len(names)
    margin = _SHORTEST + _LETTER * max(len(name.replace("$", "")) for name in names)
    wide, high = max(margin + size + _BAR, _NARROWEST), _TOP + size + margin
    figure = style.page(high, wide)
    axes = style.place(figure, margin, _TOP, size, size)
    picture = axes.imshow(judgement.correlations, cmap="RdBu_r", vmin=-1, vmax=1)
    for row, line in enumerate(judgement.correlations):
        for column, value in enumerate(line):
            axes.text(column, row, f"{round(value, 2) + 0.0:.2f}", ha="center", va="center",
                      fontsize=6,
                      color="white" if abs(value) > 0.6 else "black")
    axes.set_xticks(range(len(names)), names, rotation=60, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names)), names)
    for labels in (axes.get_xticklabels(), axes.get_yticklabels()):
        for label, determined in zip(labels, sure, strict=True):
            label.set_color("black" if determined else "#8a8f98")
    figure.text(2 / wide, 1 - 2 / high, "correlations; in grey what is not determined",
                weight="bold", va="top")
    for side in axes.spines.values():
        side.set_visible(False)
    bar = style.place(figure, margin + size + 4, _TOP, 3, size)
    figure.colorbar(picture, cax=bar)
    return figure
