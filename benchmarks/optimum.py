"""The shipped optimisation as a page: ``docs/optimum.md`` with its figure (``make optimum``)."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tympan.reports.figures.optimum import draw_optimum
from tympan.studies.case import Settings
from tympan.studies.design.elements.evaluator import DesignEvaluator
from tympan.studies.design.elements.optimise import OptimiseResult, optimise
from tympan.studies.design.elements.space import ElementSpace
from tympan.studies.design.quantities import QUANTITIES
from tympan.studies.design.requirements import Requirements
from tympan.studies.limits import limits
from tympan.studies.limits.voltages import END_VERBS

#: An ellipse whose semi-axes differ by less, relative, is a circle as far as the mesh can tell.
_ROUND = 0.02

_DOCS = Path(__file__).parent.parent / "docs"


def main() -> None:
    """Run it whole, then frame and plate each for itself, and write the page."""
    problem = ElementSpace.of(Requirements.shipped())
    whole = optimise(problem)
    parts = {name: optimise(_only(problem, name)) for name in ("frame", "plate")}
    with tempfile.TemporaryDirectory() as folder:
        picture, _ = draw_optimum(whole, Path(folder))
        shutil.copy(picture, _DOCS / "optimum.png")
    (_DOCS / "optimum.md").write_text(page(problem, whole, parts), encoding="utf-8")


def page(problem: ElementSpace, whole: OptimiseResult, parts: dict[str, OptimiseResult]
         ) -> str:
    """The page as Markdown."""
    record, reference = whole.record, whole.record["reference"]
    optima = record["optima"]
    head = " | ".join(f"equal frame {optimum['held']}" for optimum in optima)
    lines = [
        "# Example of an optimum: the ellipse with the largest stroke", "",
        f"Stroke is the deflection at {problem.case.voltage / 1e3:g} kV minus that without "
        f"voltage, under {problem.case.mass * 1e3:g} g. "
        "`make optimum` makes this page in about a minute from `studies/design/ellipse.toml`. "
        "`tympan design` without a file runs the search alone.", "",
        f"The reference: `{reference['specimen']}`, stroke {1e3 * reference['stroke_m']:.4f} mm, "
        + ", ".join(f"{_words(name)} {_shown(name, value)}"
                    for name, value in reference["limited"].items())
        + ".", "", "![Outlines along the way, stroke and limits](optimum.png)", "",
        f"| | {head} |", "|---|" + "---|" * len(optima), *_rows(record), "",
        "Gain over the reference when only one part may change, with the same limits:", "",
        f"| varied | {head} |", "|---|" + "---|" * len(optima),
        *(f"| {name} | " + " | ".join(f"{optimum['gain']:+.2%}"
                                      for optimum in result.record["optima"]) + " |"
          for name, result in {**parts, "both": whole}.items()), "",
        "## What this says", "", *_meaning(optima), "",
        "## How far to trust it", "", *_trust(problem, whole)]
    return "\n".join(lines) + "\n"


def _meaning(optima: list[dict[str, Any]]) -> list[str]:
    """In words, of what was found."""
    lines = []
    for optimum in optima:
        x, y = (1e3 * optimum["variables"][f"frame.semi_axes.{axis}"] for axis in range(2))
        shape = f"{x:.1f} by {y:.1f} mm"
        if abs(x / y - 1) < _ROUND:
            shape += f", the circle except for {abs(x / y - 1):.1%}"
        active = [_words(name) for name, limit in optimum["limits"].items() if limit["active"]]
        bounds = ", ".join(optimum["at_bounds"])
        lines.append(f"* Equal {optimum['held']}: the best frame among ellipses is {shape}. "
                     + (f"It is at the bounds of {bounds}" if bounds
                        else "It is at no bound of a variable")
                     + f". Active limits: {', '.join(active) or 'none'}.")
    return [*lines,
            "* The table above splits the gain between frame and plate. If the frame must not be "
            "higher than the reference's, state that as a bound in `[vary]`."]


def _rows(record: Mapping[str, Any]) -> list[str]:
    stored = record["optima"]
    rows = [["status", *(optimum["status"] for optimum in stored)]]
    for key in record["variables"]:
        rows.append([f"{key} [mm]",
                     *(f"{1e3 * optimum['variables'][key]:.3f}" for optimum in stored)])
    rows += [["stroke [mm]", *(f"{1e3 * optimum['stroke_m']:.4f}" for optimum in stored)],
             ["gain over the reference", *(f"{optimum['gain']:+.2%}" for optimum in stored)],
             ["the same on a mesh twice as fine",
              *(f"{optimum['finer']['gain']:+.2%}" for optimum in stored)]]
    for name, limit in record["limits"].items():
        rows.append([f"{_words(name)}, limit {_shown(name, limit['bound'])}",
                     *(_kept(name, optimum["limits"][name]) for optimum in stored)])
    rows += [["how the film ends", *(END_VERBS[optimum["end"]] for optimum in stored)],
             ["stroke for 1 % more of what is held constant",
              *(f"{optimum['held_multiplier']:+.3f} %" for optimum in stored)],
             ["conditions of optimality miss by, relative",
              *(f"{optimum['kkt_residual']:.1e}" for optimum in stored)],
             ["starts apart, in stroke",
              *(f"{optimum['starts_apart_stroke']:.1e}" for optimum in stored)],
             ["starts apart, in a variable, of its bounds",
              *(f"{optimum['starts_apart_variables']:.1e}" for optimum in stored)],
             ["designs tried, by start",
              *(", ".join(str(run["trials"]) for run in optimum["starts"])
                for optimum in stored)]]
    return ["| " + " | ".join(row) + " |" for row in rows]


def _kept(name: str, limit: dict[str, float]) -> str:
    text = f"{_shown(name, limit['value'])}, finer mesh {_shown(name, limit['finer'])}"
    return text + (f"; active, {limit['multiplier']:.2f} % of stroke per %" if limit["active"]
                   else "")


def _trust(problem: ElementSpace, whole: OptimiseResult) -> list[str]:
    lines = []
    for optimum in whole.record["optima"]:
        short = ", ".join(f"{_words(name)} {share - 1:.1%}"
                          for name, share in _scales(problem, optimum).items())
        lines.append(f"* Equal {optimum['held']}: the search uses norms for the largest nodal "
                     f"values, which exceed these norms: {short}. "
                     "The search scales the norms by that, again on every new mesh.")
        lines += [f"* Equal {optimum['held']}: {warning}" for warning in optimum["warnings"]]
    return [*lines,
            "* Derivatives are exact for the mesh at hand; the tests check this by Taylor's test. "
            "Within a step meshes are moved, not made again. So designs are compared without the "
            "noise of meshing.",
            *_confirmed(problem, whole),
            "* The margin is that of the perfect film. A film that thins as it loses tension does "
            "so at the plate's edge. The margin then differs between meshes by more than the "
            "stroke does. So do semi-axes that are nearly equal, because each place around the "
            "plate has a limit of its own."]


def _confirmed(problem: ElementSpace, whole: OptimiseResult) -> Iterator[str]:
    """What `tympan limits` says of each optimum's own specimen."""
    for optimum in whole.record["optima"]:
        specimen = whole.specimens[optimum["specimen_file"]]
        reached = limits(replace(problem.case, specimen=specimen), Settings())
        end = min((limit for limit in reached.reached if limit.state.ends),
                  key=lambda limit: limit.voltage_V)
        margin, stated = end.voltage_V / problem.case.voltage, optimum["limits"]["pull_in_margin"]
        yield (f"* Equal {optimum['held']}: `tympan limits` of the optimum's specimen, on a mesh "
               f"of its own, says: {reached.ended}. That is {margin:.4f} times the voltage, "
               f"± {end.spread:.2%}; this page states a margin of {stated['value']:.4f}.")


def _scales(problem: ElementSpace, optimum: dict[str, Any]) -> dict[str, float]:
    bench = DesignEvaluator(problem, Settings())
    values = np.array(list(optimum["variables"].values()))
    bench.at((values - problem.lows) / problem.widths, renew=True)
    return bench.memory.scales


def _only(problem: ElementSpace, part: str) -> ElementSpace:
    """The problem with the numbers of one part alone, from the specimen itself."""
    return replace(problem, requirements=replace(problem.requirements, starts=()), variables=tuple(
        variable for variable in problem.variables if variable.key.startswith(part)))


def _words(name: str) -> str:
    return name.replace("_", " ")


def _shown(name: str, value: float) -> str:
    shown = {"Pa": (1e-3, " kPa"), "V/m": (1e-6, " MV/m"), "m": (1e3, " mm")}
    scale, text = shown.get(QUANTITIES[name].unit, (1.0, ""))
    return f"{scale * value:.4g}{text}"


if __name__ == "__main__":
    main()
