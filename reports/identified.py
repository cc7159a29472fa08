"""What readings determine of a model's constants: profiles of the likelihood, and correlations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from reports import style
from studies.lumped.intervals import Judgement
from studies.lumped.misfit import Profile

_LEFT, _RIGHT, _TOP, _BOTTOM = 14.0, 4.0, 8.0, 13.0  # [mm]
_SYMBOLS = {"relative_permittivity": "ε$_r$", "alpha_1": "α₁", "beta_1": "β₁", "beta_2": "β₂", "beta_3": "β₃",
            "gamma_1": "γ₁", "gamma_2": "γ₂", "gamma_3": "γ₃", "k_1": "k₁", "eta_1": "η₁", "eta_2": "η₂"}
_PANEL, _COLUMNS, _CELL, _LONGEST, _BAR = 38.0, 3, 11.0, 34.0, 20.0


def draw_profiles(judgement: Judgement, folder: Path, formats: Sequence[str] = ("png", "svg")) -> list[Path]:
    """Draw folder/profiles: of each constant that has one, √Δχ² over its value, with the 95 % limits.

    A straight V is a linear problem; a branch that never meets the dotted line leaves its side open.
    """
    style.check(formats)
    with style.look():
        return style.save(_profiles(judgement), folder, "profiles", formats)


def draw_correlations(judgement: Judgement, folder: Path, formats: Sequence[str] = ("png", "svg")) -> list[Path]:
    """Draw folder/correlations: the linearised correlations of the constants, those not determined in grey."""
    style.check(formats)
    with style.look():
        return style.save(_correlations(judgement), folder, "correlations", formats)


def _symbol(name: str) -> str:
    """As the paper writes it; of an α with the shape it belongs to."""
    plain, _, shape = name.partition("[")
    return _SYMBOLS.get(plain, plain) + (f" ({shape[:-1]})" if shape else "")


def _profiles(judgement: Judgement) -> Figure:
    drawn = [(one, line) for one, line in zip(judgement.constants, judgement.profiles, strict=True) if line is not None]
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
                axes.axvline(judgement.to_value(one.name, end), color=colour, linewidth=0.6, linestyle="--")
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
    figure = style.page(_TOP + size + _LONGEST, _LONGEST + size + _BAR)
    axes = style.place(figure, _LONGEST, _TOP, size, size)
    picture = axes.imshow(judgement.correlations, cmap="RdBu_r", vmin=-1, vmax=1)
    for row, line in enumerate(judgement.correlations):
        for column, value in enumerate(line):
            axes.text(column, row, f"{round(value, 2) + 0.0:.2f}", ha="center", va="center", fontsize=6,
                      color="white" if abs(value) > 0.6 else "black")
    axes.set_xticks(range(len(names)), names, rotation=60, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names)), names)
    for labels in (axes.get_xticklabels(), axes.get_yticklabels()):
        for label, determined in zip(labels, sure, strict=True):
            label.set_color("black" if determined else "#8a8f98")
    axes.set_title("correlations; in grey what is not determined", loc="left", weight="bold")
    for side in axes.spines.values():
        side.set_visible(False)
    bar = figure.add_axes((1 - (_BAR - 4) / (_LONGEST + size + _BAR), _LONGEST / (_TOP + size + _LONGEST),
                           3 / (_LONGEST + size + _BAR), size / (_TOP + size + _LONGEST)))
    figure.colorbar(picture, cax=bar)
    return figure
