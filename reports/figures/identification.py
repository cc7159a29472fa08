"""Constants of a model determined from readings: profiles of the likelihood, correlations."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.estimation.identifiability import Identifiability
from tympan.studies.identify.result import Fitted, IdentifyResult

#: Height above a profile, and above the correlations, for a title [mm].
_TOP = 8.0
#: Height below a profile for its numbers and words [mm].
_BOTTOM = 13.0

#: Height of the axis of residuals below static readings [mm].
_VOLTAGE = 22.0
#: Height of the axis of static readings [mm].
_RESPONSE = 60.0

#: Height of the axis of responses in time [mm].
_WHOLE = 45.0
#: Height of the axis of residuals below it [mm].
_LEFTOVER = 18.0
#: Most points of a line: more are not visible, and make a large file.
_POINTS = 5000

_BEGINNING = 30.0  # radians of the fast oscillation that are shown on their own
_SYMBOLS = {"relative_permittivity": "ε$_r$", "alpha_1": "α₁", "beta_1": "β₁", "beta_2": "β₂",
            "beta_3": "β₃", "gamma_1": "γ₁", "gamma_2": "γ₂", "gamma_3": "γ₃", "k_1": "k₁",
            "eta_1": "η₁", "eta_2": "η₂"}

#: Height of a profile [mm].
_PANEL = 38.0
#: Side of a correlation's square [mm], large enough for its number.
_CELL = 11.0
#: Width on the right for the colour bar [mm].
_BAR = 20.0
#: Width for the names of the constants, without their letters [mm].
_SHORTEST = 6.0
#: Width of each letter of a constant's name [mm].
_LETTER = 1.3
#: Narrowest figure of correlations, for its title [mm].
_NARROWEST = 75.0

_COLUMNS = 3
_UP = "displacement (mm)", "fit − read (µm)"


def draw_identified(result: IdentifyResult, folder: Path) -> list[Path]:
    """Draw the fits, profiles and correlations of an identification; return the files."""
    files = []
    for name, compose, suffix in (("static", _static, ""), ("dynamic", _dynamic, "-dynamic")):
        if name in result.fits:
            fit = result.fits[name]
            files += style.save_figure(folder, name, partial(compose, fit))
            files += draw_profiles(fit.determined, folder, f"profiles{suffix}")
            files += draw_correlations(fit.determined, folder, f"correlations{suffix}")
    return files


def draw_profiles(judgement: Identifiability, folder: Path, name: str = "profiles") -> list[Path]:
    """Draw folder/name: √Δχ² over each constant that has a profile, with the 95 % limits.

    A straight V means a linear problem; if a branch never meets the dotted line, that side has no
    limit.
    """
    return style.save_figure(folder, name, lambda: _profiles(judgement))


def draw_correlations(judgement: Identifiability, folder: Path,
                      name: str = "correlations") -> list[Path]:
    """Draw folder/name: linearised correlations; constants that are not determined in grey."""
    return style.save_figure(folder, name, lambda: _correlations(judgement))


def _symbol(name: str) -> str:
    """Write a constant with the paper's symbol, an α with its shape."""
    plain, _, shape = name.partition("[")
    return _SYMBOLS.get(plain, plain) + (f" ({shape[:-1]})" if shape else "")


def _static(fit: Fitted) -> Figure:
    """Draw a column for each mass: readings and fit above, residuals below."""
    masses = sorted(fit.readings["mass"].unique())
    names = fit.readings["specimen"].unique().tolist()
    figure, pairs = style.pairs(len(masses), _RESPONSE, _VOLTAGE)
    for column, (mass, (above, below)) in enumerate(zip(masses, pairs, strict=True)):
        for part in (part for part in fit.runs if part["mass"].iloc[0] == mass):
            name = part["specimen"].iloc[0]
            colour = style.colour_of(names.index(name))
            volts, read, fitted = part[["voltage", "displacement", "fitted"]].to_numpy().T
            above.plot(1e-3 * volts, 1e3 * read, "o", color=colour, markersize=3,
                       markerfacecolor="none", label=name)
            above.plot(1e-3 * volts, 1e3 * fitted, color=colour, linewidth=0.8)
            below.plot(1e-3 * volts, 1e6 * (fitted - read), "o-", color=colour, markersize=2,
                       linewidth=0.5)
        above.legend(loc="upper left")
        up, error = _UP if column == 0 else ("", "")
        style.describe(above, "", up, f"{1e3 * mass:g} g", bold=True)
        style.describe(below, "voltage (kV)", error)
    return figure


def _dynamic(fit: Fitted) -> Figure:
    """Draw a row for each mass: readings, fit and residuals, and on the right their beginning."""
    masses = sorted(fit.readings["mass"].unique())
    names = fit.readings["specimen"].unique().tolist()
    height = style.TITLE + _WHOLE + style.GAP + _LEFTOVER + style.AXIS
    figure = style.new_figure(len(masses) * height)
    width = style.WIDTH / 2 - style.LEFT - style.RIGHT
    for row, mass in enumerate(masses):
        for column, end in enumerate((np.inf, _BEGINNING * (fit.radian or np.inf))):
            above, below = style.place_pair(
                figure, style.LEFT + column * style.WIDTH / 2, style.TITLE + row * height, width,
                (_WHOLE, style.GAP, _LEFTOVER))
            for part in fit.runs:
                name, loaded = part[["specimen", "mass"]].iloc[0]
                if loaded == mass:
                    _response(above, below, part, end, style.colour_of(names.index(name)))
            up, error = _UP if column == 0 else ("", "")
            title = f"{1e3 * mass:g} g" if column == 0 else ""
            style.describe(above, "", up, title, bold=True)
            style.describe(below, "time since the voltage changed (s)", error)
        above.plot([], [], color="black", linewidth=0.5, label="fit")
        above.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=len(names) + 1)
    return figure


def _response(above: Axes, below: Axes, part: pd.DataFrame, end: float, colour: str) -> None:
    """Draw a run up to a time since its voltage changed: readings, fit, residuals below."""
    since, read, fitted = part[["since", "displacement", "fitted"]].to_numpy().T
    inside = np.flatnonzero((since <= end) & (since >= -end / 5))
    thin = np.linspace(0, len(inside) - 1, min(len(inside), _POINTS)).astype(int)
    inside = inside[np.unique(thin)]
    since, read, fitted = since[inside], read[inside], fitted[inside]
    above.plot(since, 1e3 * read, ".", color=colour, markersize=3, markeredgewidth=0,
               rasterized=True, label=part["specimen"].iloc[0])
    above.plot(since, 1e3 * fitted, color="black", linewidth=0.5)
    below.plot(since, 1e6 * (fitted - read), ".", color=colour, markersize=1.5, markeredgewidth=0,
               rasterized=True)


def _profiles(judgement: Identifiability) -> Figure:
    drawn = [(constant, profile) for constant, profile
             in zip(judgement.constants, judgement.profiles, strict=True) if profile is not None]
    figure, panels = style.panels(len(drawn), _COLUMNS, _PANEL, _TOP, _BOTTOM)
    if not drawn:
        figure.text(0.5, 0.5, "these data determine none of the constants", ha="center")
    for number, (axes, (constant, profile)) in enumerate(zip(panels, drawn, strict=True)):
        colour = style.PALETTE[0] if constant.low is not None else style.PALETTE[1]
        factor, prefix = _prefix(float(np.abs(profile.values).max()), constant.unit)
        values = profile.values / factor
        axes.plot(values, np.abs(profile.rise), "o-", color=colour, markersize=2.5, linewidth=0.8)
        axes.axhline(judgement.quantile, color="black", linewidth=0.6, linestyle=":")
        for limit in (profile.low, profile.high):
            if limit is not None:
                axes.axvline(limit / factor, color=colour, linewidth=0.6, linestyle="--")
        # The axis shows a little more than the limits; all trials where one limit is open.
        inside = values[np.abs(profile.rise) <= 1.2 * np.abs(profile.rise).max()]
        low, high = float(inside.min()), float(inside.max())
        edge = 0.08 * (high - low or abs(low) or 1.0)
        axes.set_xlim(low - edge, high + edge)
        axes.set_ylim(0, 1.5 * judgement.quantile)
        axes.set_title(_symbol(constant.name), loc="left", weight="bold")
        axes.set(xlabel="" if constant.unit == "1" else f"({prefix}{constant.unit})",
                 ylabel="" if number % _COLUMNS else "√(χ² − χ²min)")
        axes.ticklabel_format(axis="x", useOffset=False, scilimits=(-3, 5))
        axes.locator_params(axis="x", nbins=4)
    return figure


def _prefix(largest: float, unit: str) -> tuple[float, str]:
    """Choose a prefix and its factor that leave numbers below a thousand."""
    if unit != "1" and largest >= 1e6:
        return 1e6, "M"
    return (1e3, "k") if unit != "1" and largest >= 1e3 else (1.0, "")


def _correlations(judgement: Identifiability) -> Figure:
    names = [_symbol(constant.name) for constant in judgement.constants]
    sure = np.array([constant.low is not None for constant in judgement.constants])
    size = _CELL * len(names)
    margin = _SHORTEST + _LETTER * max(len(name.replace("$", "")) for name in names)
    wide, high = max(margin + size + _BAR, _NARROWEST), _TOP + size + margin
    figure = style.new_figure(high, wide)
    axes = style.place_axes(figure, margin, _TOP, size, size)
    picture = axes.imshow(judgement.correlations, cmap="RdBu_r", vmin=-1, vmax=1)
    for row, line in enumerate(judgement.correlations):
        for column, value in enumerate(line):
            axes.text(column, row, f"{round(value, 2) + 0.0:.2f}", ha="center", va="center",
                      fontsize=6, color="white" if abs(value) > 0.6 else "black")
    axes.set_xticks(range(len(names)), names, rotation=60, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names)), names)
    for labels in (axes.get_xticklabels(), axes.get_yticklabels()):
        for label, determined in zip(labels, sure, strict=True):
            label.set_color("black" if determined else "#8a8f98")
    figure.text(2 / wide, 1 - 2 / high, "correlations; in grey what is not determined",
                weight="bold", va="top")
    axes.spines[:].set_visible(False)
    figure.colorbar(picture, cax=style.place_axes(figure, margin + size + 4, _TOP, 3, size))
    return figure
