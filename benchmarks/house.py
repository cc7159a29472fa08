"""The map of the house: packages, their chapters on floors, who imports whom.

From the import graph.

Run as ``python -m benchmarks.house`` (``make house``); writes docs/house.svg. A chapter, a folder
or a file of a package, stands one floor above the highest of those it imports; arrows that others
already imply are left out.
"""

from __future__ import annotations

from itertools import cycle
from pathlib import Path

import grimp
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tympan.reports.look import MM, PALETTE, figure_style

PACKAGES = {"base": "files, units, errors, processes", "tables": "testers' tables",
            "geometry": "specimens, CAD, meshes", "fem": "the membrane",
            "studies": "cases, sweeps, lumped model, measured data",
            "reports": "figures and pages", "tympan": "public door, commands, explorer"}
FILE = Path("docs/house.svg")
_WIDTH, _FLOOR, _BOX, _GAP, _HEAD = 180.0, 8.5, 4.6, 2.0, 5.0  #: [mm]
_LETTER = 1.28  #: width of one [mm]


def chapters(graph: grimp.ImportGraph, package: str) -> dict[str, set[str]]:
    """The chapters of a package, each with those it imports."""
    root = "tympan" if package == "tympan" else f"tympan.{package}"
    others = {f"tympan.{name}" for name in PACKAGES} if package == "tympan" else set()
    names = {name for name in graph.find_children(root) if name not in others}
    inside = {name: {name} | graph.find_descendants(name) for name in names}
    uses = {name: {imported for module in modules
                   for imported in graph.find_modules_directly_imported_by(module)}
            for name, modules in inside.items()}
    return {name: {other for other in names if other != name and uses[name] & inside[other]}
            for name in sorted(names)}


def floors(imports: dict[str, set[str]]) -> list[list[str]]:
    """Chapters by floor, the lowest first."""
    level: dict[str, int] = {}

    def floor(name: str, above: tuple[str, ...] = ()) -> int:
        if name not in level:
            below = [floor(other, (*above, name)) for other in imports[name] if other not in above]
            level[name] = 1 + max(below, default=-1)
        return level[name]

    highest = max(map(floor, imports))
    return [[name for name in imports if level[name] == number] for number in range(highest + 1)]


def reduced(imports: dict[str, set[str]]) -> dict[str, set[str]]:
    """The imports without those that follow from others."""
    def reached(name: str, seen: set[str]) -> set[str]:
        for other in imports[name] - seen:
            seen.add(other)
            reached(other, seen)
        return seen

    return {name: {other for other in others
                   if not any(other in reached(between, set()) for between in others - {other})}
            for name, others in imports.items()}


def draw(graph: grimp.ImportGraph) -> Figure:
    """Draw the whole house, the base at the bottom."""
    plan = {package: chapters(graph, package) for package in PACKAGES}
    heights = {package: _HEAD + _FLOOR * len(floors(imports)) for package, imports in plan.items()}
    height = sum(heights.values()) + _GAP * (len(plan) + 1)
    figure = Figure(figsize=(_WIDTH * MM, height * MM))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, _WIDTH), ylim=(0, height))
    axes.set_axis_off()
    bottom = _GAP
    for (package, imports), colour in zip(plan.items(), cycle(PALETTE), strict=False):
        axes.fill_between((_GAP, _WIDTH - _GAP), bottom, bottom + heights[package], color=colour,
                          alpha=0.08, linewidth=0)
        axes.text(2 * _GAP, bottom + heights[package] - 3.4, package, weight="bold", color=colour)
        axes.text(2 * _GAP + 1.7 * (len(package) + 1), bottom + heights[package] - 3.4,
                  PACKAGES[package], color=colour)
        middle: dict[str, tuple[float, float]] = {}
        for number, names in enumerate(floors(imports)):
            widths = [_LETTER * len(name.rpartition(".")[2]) + 3 for name in names]
            space = (_WIDTH - 4 * _GAP - sum(widths)) / len(names)
            edge = 2 * _GAP + space / 2
            for name, width in zip(names, widths, strict=True):
                middle[name] = edge + width / 2, bottom + _FLOOR * number + _FLOOR / 2
                edge += width + space
        for name, others in reduced(imports).items():
            for other in others:
                axes.annotate("", middle[other], middle[name], zorder=1, arrowprops={
                    "arrowstyle": "-|>,head_length=0.25,head_width=0.12", "color": colour,
                    "alpha": 0.5, "linewidth": 0.5, "shrinkA": 0, "shrinkB": 7})
        for name, (x, y) in middle.items():
            axes.text(x, y, name.rpartition(".")[2], ha="center", va="center", zorder=2,
                      bbox={"boxstyle": "round,pad=0.3", "facecolor": "white", "edgecolor": colour,
                            "linewidth": 0.7})
        bottom += heights[package] + _GAP
    return figure


if __name__ == "__main__":
    with figure_style():
        draw(grimp.build_graph("tympan", cache_dir=None)).savefig(FILE, metadata={"Date": None})
