"""The shipped design as a page: ``docs/optimum.md`` with its picture (``make optimum``)."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from tympan.base.process.threads import one_thread
from tympan.base.units import BENCH
from tympan.geometry.outlines import perimeter
from tympan.reports.figures.design import draw_design
from tympan.studies.case import Settings
from tympan.studies.design.design import design
from tympan.studies.design.exact import ExactFilm
from tympan.studies.design.requirements import Requirements
from tympan.studies.design.result import DesignedFilm, DesignedQuantity, DesignResult
from tympan.studies.wanted import QUANTITIES, TENSION, Bound

#: Semi-axes of an ellipse that differ by less, relative, are those of a circle for this search.
_ROUND = 0.02
#: Largest strokes [mm] that an earlier search found, by finite elements and their derivatives
#: alone, in frames of the same area and of the same perimeter.
_BY_ELEMENTS = {"frame_area": 2.3191, "frame_perimeter": 2.3726}
#: Parts that vary, by what the page calls them, and how their keys begin.
_PARTS = {"frame": ("frame.",), "plate": ("plate.",), "both": ("frame.", "plate.")}

_DOCS = Path(__file__).parent.parent / "docs"


@one_thread()
def main() -> None:
    """Search frame, plate and both, by area and by perimeter, and write the page."""
    shipped = Requirements.shipped()
    results = {(room, part): design(_only(_in_room(shipped, room), begins))
               for room in _BY_ELEMENTS for part, begins in _PARTS.items()}
    best = results["frame_area", "both"]
    with tempfile.TemporaryDirectory() as folder:
        picture, _ = draw_design(best, Path(folder))
        shutil.copy(picture, _DOCS / "optimum.png")
    (_DOCS / "optimum.md").write_text(page(shipped, results), encoding="utf-8")


def _in_room(requirements: Requirements, room: str) -> Requirements:
    """The requirements with the frame's area or perimeter at most that of the given film."""
    specimen, = requirements.specimens
    size = {"frame_area": requirements.bounds["frame_area"],
            "frame_perimeter": Bound("frame_perimeter", float(perimeter(specimen.frame)), False)}
    bounds = {key: bound for key, bound in requirements.bounds.items() if key not in size}
    return replace(requirements, bounds={**bounds, room: size[room]})


def _only(requirements: Requirements, begins: tuple[str, ...]) -> Requirements:
    """The requirements with the numbers of some parts alone."""
    return replace(requirements, variables={
        name: tuple(each for each in several if each.key.startswith(begins))
        for name, several in requirements.variables.items()})


def page(shipped: Requirements, results: dict[tuple[str, str], DesignResult]) -> str:
    """The page as Markdown."""
    specimen, = shipped.specimens
    best, = results["frame_area", "both"].films
    heads = " | ".join(f"{_words(room)} at most as now" for room in _BY_ELEMENTS)
    lines = [
        "# Example of a design: the ellipse with the largest stroke", "",
        "`tympan design` without a file searches the ellipse and the plate with the largest stroke "
        f"from 0 to {shipped.voltage / 1e3:g} kV under {shipped.mass * 1e3:g} g. The frame may be "
        f"at most as large as that of `{specimen.name}`. The requirements are "
        "`studies/design/ellipse.toml`. `make optimum` makes this page in about a minute.", "",
        "![Outline of the best film, and its bounds](optimum.png)", "",
        "| | now | best | wanted | binds |", "|---|---|---|---|---|",
        *(_row(each) for each in best.quantities if each.given is not None), "",
        "Stroke, and gain over the film as it is now, if only one part may change:", "",
        f"| varied | {heads} |", "|---|" + "---|" * len(_BY_ELEMENTS),
        *(f"| {part} | " + " | ".join(_gain(results[room, part].films[0])
                                      for room in _BY_ELEMENTS) + " |" for part in _PARTS), "",
        "## What this says", "", *_meaning(results), "",
        "## How far to trust it", "", *_trust(shipped, results)]
    return "\n".join(lines) + "\n"


def _row(each: DesignedQuantity) -> str:
    wanted = "" if each.bound is None else f"{each.sense} {_shown(each.name, each.bound)}"
    relaxed = "" if each.relaxing is None else (
        f"yes: 1 % less strict gives {100 * each.relaxing:.2g} % of stroke")
    return " | ".join([f"| {_words(each.name)}", _shown(each.name, each.given),
                       _shown(each.name, each.value), wanted, f"{relaxed} |"])


def _gain(film: DesignedFilm) -> str:
    stroke = film.quantity("stroke")
    assert stroke.value is not None
    assert stroke.given is not None
    return f"{1e3 * stroke.value:.3f} mm, {stroke.value / stroke.given - 1:+.1%}"


def _meaning(results: dict[tuple[str, str], DesignResult]) -> Iterator[str]:
    """In words, what was found."""
    for room in _BY_ELEMENTS:
        film, = results[room, "both"].films
        x, y, radius = (1e3 * number.value for number in film.numbers.values())
        shape = f"{x:.1f} by {y:.1f} mm"
        if abs(x / y - 1) < _ROUND:
            shape += f", a circle but for {abs(x / y - 1):.1%}"
        binding = " and ".join(_words(each.name) for each in film.binding)
        yield (f"* With its {_words(room)} bounded, the best frame has semi-axes {shape}. The "
               f"plate's radius is {radius:.2f} mm. What binds: {binding}.")
    yield ("* The table splits the gain between frame and plate. If the frame must not be higher "
           "than it is now, write `height` under `[want]`.")


def _trust(shipped: Requirements, results: dict[tuple[str, str], DesignResult]) -> Iterator[str]:
    settings = Settings()
    finer = replace(settings, mesh=settings.mesh.refined(2))
    for room, known in _BY_ELEMENTS.items():
        result = results[room, "both"]
        film, = result.films
        stroke = film.quantity("stroke")
        assert stroke.value is not None
        assert stroke.reduced is not None
        again = ExactFilm(result.specimens[film.specimen_file], shipped.mass, shipped.voltage,
                          shipped.rig, finer, shipped.margin)
        there, margin = (float(QUANTITIES[key].of(again)[0]) for key in ("stroke", TENSION))
        yield (f"* {_words(room).capitalize()}: the stroke by finite elements is "
               f"{1e3 * stroke.value:.4f} mm, by the reduced film {1e3 * stroke.reduced:.4f} mm, "
               f"on a mesh twice as fine {1e3 * there:.4f} mm. The margin to the loss of tension "
               f"on that mesh is {margin:.4f}. An earlier search, by finite elements alone, found "
               f"{known:.4f} mm.")
    yield ("* The margins are those of the film as drawn. `tolerances = \"none\"` in the file says "
           "so; without that line 95 % of the films with their tolerances keep all bounds.")


def _words(name: str) -> str:
    return name.replace("_", " ")


def _shown(name: str, value: float | None) -> str:
    unit = QUANTITIES[name].unit
    word, scale = BENCH.get(unit, (unit, 1.0))
    return "" if value is None else f"{scale * value:.5g}{f' {word}' if word != '1' else ''}"


if __name__ == "__main__":
    main()
