"""What the trials with effects of any size add up to: rates by size, and maps of effects that look
alike."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.trials.rates.rate import GONE, Rate, share
from benchmarks.trials.record import Record
from benchmarks.trials.trial import ALIAS_PAIRS, MAP_WIDTHS, WRONG_SCALES
from tympan.studies.diagnosis.inference.identifiability import SEEN

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Edges of the bands of sizes over the typical one, and of the finer ones of the figure.
BANDS, _FINE = (0.3, 1.0, 3.0, 8.0, 20.0), (0.3, 0.6, 1.0, 1.8, 3.0, 5.0, 8.0, 13.0, 20.0)
#: What may be named wrongly, or be called unexplained though the library has it, in every band.
WRONG, UNEXPLAINED = 0.02, 0.05

#: Populations of single effects of any size, and how the typical sizes were taken.
SCALES = {"large": "as they are",
          **{name: name.removeprefix("large, priors ").replace("wide", "large")
             for name in WRONG_SCALES}}

#: What is said of an effect, and its colour.
_SAID = {"named": "#117733", "listed": "#88ccaa", "unexplained": "#b8bdc7", "nothing": "#e4e6ea",
         "others listed": "#eebb99", "another named": "#c23b22"}


def said(record: Record) -> str:
    """What was said of what was hidden."""
    truth = set(record.truth)
    if record.verdict == "named":
        return "named" if set(record.named) == truth else "another named"
    if record.verdict == "ambiguous":
        return "listed" if truth <= set(record.listed) else "others listed"
    return record.verdict


def band(records: Sequence[Record], population: str, low: float, high: float) -> list[Record]:
    """Trials of a population whose effect is so many typical sizes large."""
    return [record for record in records
            if record.population == population and record.verdict not in GONE
            and low <= record.widths[0] < high]


def size_rates(records: Sequence[Record]) -> list[Rate]:
    """What must hold in every band, for every scale of the typical sizes."""
    rates = []
    for population, words in SCALES.items():
        for low, high in pairwise(BANDS):
            those = band(records, population, low, high)
            of = f"one effect of {low:g} to {high:g} typical sizes, taken {words}"
            rates.append(share(f"{of}: another is named", those, lambda record: record.misnamed,
                               high=WRONG))
            rates.append(share(f"{of}: unexplained", those,
                               lambda record: record.verdict == "unexplained", high=UNEXPLAINED))
    pairs = [record for record in records
             if record.population == "large pair" and record.verdict not in GONE]
    rates.append(share("two effects of 1 to 10 typical sizes: a wrong one is named", pairs,
                       lambda record: record.misnamed, high=WRONG))
    rates.append(share("the same: unexplained", pairs,
                       lambda record: record.verdict == "unexplained", high=UNEXPLAINED))
    return rates


def size_lines(records: Sequence[Record]) -> list[str]:
    """The page's table of rates by size."""
    lines = ["| typical sizes taken | size over typical | trials | detected, of Δχ² ≥ 25 | "
             "first, of these | named, of these | named, of identifiable | another named | "
             "unexplained |",
             "|---|---|---|---|---|---|---|---|---|"]
    for population, words in SCALES.items():
        for low, high in pairwise(BANDS):
            those = band(records, population, low, high)
            clear = [record for record in those if record.seen >= SEEN]
            sure = [record for record in those if record.identifiable]
            cells = [
                share("", clear, lambda record: record.verdict != "nothing"),
                share("", clear,
                      lambda record: bool(record.ranked) and record.ranked[0][0] in record.truth),
                share("", clear, lambda record: said(record) == "named"),
                share("", sure, lambda record: said(record) == "named"),
                share("", those, lambda record: record.misnamed, high=WRONG),
                share("", those, lambda record: record.verdict == "unexplained", high=UNEXPLAINED)]
            lines.append(f"| {words} | {low:g}–{high:g} | {len(those)} | "
                         + " | ".join(map(_cell, cells)) + " |")
    return lines


def _cell(rate: Rate) -> str:
    if not rate.count:
        return "–"
    low, high = rate.interval
    words = f"{rate.share:.0%} ({low:.0%} to {high:.0%})"
    return words if rate.met else f"**{words}**"


def draw_sizes(records: Sequence[Record], file: Path) -> None:
    """Shares of what was said against the size, for every scale of the typical sizes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 3.6), layout="constrained")
    panels = figure.subplots(1, len(SCALES), sharey=True)
    names = [f"{low:g}–{high:g}" for low, high in pairwise(_FINE)]
    for axes, (population, words) in zip(panels, SCALES.items(), strict=True):
        groups = [band(records, population, low, high) for low, high in pairwise(_FINE)]
        start = np.zeros(len(groups))
        for what, colour in _SAID.items():
            part = np.array([
                100 * sum(said(record) == what for record in group) / max(len(group), 1)
                for group in groups])
            axes.bar(range(len(groups)), part, bottom=start, color=colour, width=0.9, label=what)
            start += part
        labels = [f"{name}\n({len(group)})" for name, group in zip(names, groups, strict=True)]
        axes.set_xticks(range(len(groups)), labels, fontsize=6.5)
        axes.set_title(f"typical sizes taken {words}", loc="left", fontsize=9)
        axes.set_xlabel("size over the typical one (trials)")
    panels[0].set_ylabel("share of trials (%)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center",
                  ncols=len(_SAID), frameon=False, fontsize=8)
    figure.savefig(file, dpi=150)


def draw_maps(records: Sequence[Record], file: Path) -> None:
    """The verdict over the true sizes of two effects that look alike."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    for axes, (number, pair) in zip(figure.subplots(1, len(ALIAS_PAIRS)), enumerate(ALIAS_PAIRS),
                                    strict=True):
        count = len(MAP_WIDTHS) ** 2
        _draw_map(axes, pair, [record for record in records if record.population == "map"
                               and record.widths and record.number // count == number])
    words = {"first named": _MAP["A"], "second named": _MAP["B"], "both named": _MAP["A, B"],
             "ambiguous (letters: what is listed)": _MAP["ambiguous"],
             "unexplained": _MAP["unexplained"], "nothing": _MAP["nothing"],
             "no equilibrium": _MAP["no equilibrium"], "one named that is not there": _MAP["wrong"]}
    figure.legend([Patch(color=colour) for colour in words.values()], [*words],
                  loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    figure.savefig(file, dpi=150)


_MAP = {"A": "#4477aa", "B": "#228833", "A, B": "#44bbaa", "ambiguous": "#ddcc77",
        "unexplained": "#b8bdc7", "nothing": "#f2f3f5", "no equilibrium": "#ffffff",
        "wrong": "#c23b22", "refused": "#000000", "raised": "#000000"}


def _draw_map(axes: Axes, pair: tuple[str, str], records: Sequence[Record]) -> None:
    from matplotlib.patches import Rectangle

    letters = dict(zip(pair, "AB", strict=True))
    for record in records:
        column, row = (MAP_WIDTHS.index(width) for width in record.widths)
        what, text = record.verdict, ""
        if record.verdict == "named":
            what = "wrong" if record.misnamed else ", ".join(sorted(letters[name]
                                                                    for name in record.named))
        elif record.verdict == "ambiguous":
            listed = {letters.get(name, "+") for name in record.listed}
            text = "".join(sorted(listed, key="AB+".index))
        axes.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, facecolor=_MAP[what],
                                 edgecolor="white", linewidth=0.8))
        axes.text(column, row, text, ha="center", va="center", fontsize=6)
    ticks = range(len(MAP_WIDTHS)), [f"{width:g}" for width in MAP_WIDTHS]
    axes.set_xticks(*ticks, fontsize=7)
    axes.set_yticks(*ticks, fontsize=7)
    limits = -0.5, len(MAP_WIDTHS) - 0.5
    axes.set(xlim=limits, ylim=limits, aspect="equal", xlabel=f"A: {pair[0]} (typical sizes)",
             ylabel=f"B: {pair[1]} (typical sizes)")
