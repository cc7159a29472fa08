"""Lumped models from field models, measured: ``docs/lumped-build.md`` (``make lumped-build``)."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np

import tympan
from tympan.fem.film.laws import Gent, NeoHooke, Ogden
from tympan.fem.film.library import load_specimen
from tympan.geometry.outlines import Circle, Ellipse, Stadium, Superellipse
from tympan.geometry.specimen import Electrode, Plate, Specimen
from tympan.paper.published import MASSES
from tympan.reports.figures.lumped_model import draw_built
from tympan.studies.case import Settings
from tympan.studies.lumped.build import KINEMATICS, BuildResult, BuildSettings, Built, build
from tympan.studies.lumped.equilibria import rest_curve

_DOCS = Path(__file__).parent.parent / "docs"
_NAMES = ("circular", "elliptical-small", "elliptical-large")


def main() -> None:
    """Build them all and write the page."""
    builds = [build(specimen, Settings(), PAPER_LOADS) for specimen in _paper()]
    others = [(words, build(specimen, Settings(), chosen)) for words, specimen, chosen in _others()]
    with tempfile.TemporaryDirectory() as folder:
        picture, _ = draw_built(BuildResult.of(builds), Path(folder))
        shutil.copy(picture, _DOCS / "lumped-build.png")
    (_DOCS / "lumped-build.md").write_text(page(builds, others), encoding="utf-8")


#: The paper's masses, up to most of its voltages.
PAPER_LOADS = BuildSettings(MASSES, tuple(500.0 * number for number in range(11)))


def _paper() -> Iterator[Specimen]:
    folder = resources.files("tympan.studies.shipped")
    return (load_specimen(str(folder / f"{name}.toml")) for name in _NAMES)


def _others() -> Iterator[tuple[str, Specimen, BuildSettings]]:
    """What it is, the specimen, and how it is built."""
    circle, _, ellipse = _paper()
    two, film = PAPER_LOADS, circle.membrane
    sectors = replace(two, radii="sectors")
    yield "superellipse 75 × 45 mm, exponent 4", replace(ellipse, frame=Superellipse((75e-3, 45e-3),
                                                                                     4.0)), two
    yield "stadium 75 × 45 mm", replace(ellipse, frame=Stadium((75e-3, 45e-3))), two
    off = replace(circle, plate=Plate(Circle(10e-3), (10e-3, 0.0)))
    yield "circle, plate 10 mm off its centre, circles by sectors", off, sectors
    yield "the same with the one circle of its frame", off, two
    yield "circle, elliptical plate 15 × 8 mm", replace(circle,
                                                        plate=Plate(Ellipse((15e-3, 8e-3)))), two
    yield "circle, 5 mm bare at frame and plate", replace(circle,
                                                          electrode=Electrode(5e-3, 5e-3)), two
    yield "circle, prestretch 2.6 by 2.0", replace(circle,
                                                   membrane=replace(film,
                                                                    prestretch=(2.6, 2.0))), two
    for words, law in (("neo-Hookean, 15 kPa", NeoHooke(15e3)),
                       ("Gent, 18 kPa, J 20", Gent(18e3, 20.0)),
                       ("Ogden, 30 and 2 kPa, powers 1.3 and 5.5", Ogden((30e3, 2e3), (1.3, 5.5)))):
        yield f"circle, {words}", replace(circle, membrane=replace(film, material=law)), two


def page(builds: Sequence[Built], others: Sequence[tuple[str, Built]]) -> str:
    """The page as Markdown."""
    circle = builds[0]
    worst = max(built.worst("corrected", held_out=True) or np.inf for built in builds)
    lines = [
        "# Accuracy of a lumped model built from the field", "",
        "`tympan lumped build SPECIMEN.toml … -o DIR` makes the lumped model of each specimen "
        "from its field model "
        "alone: α of membrane circles (`tympan alpha`), the film's own law in a membrane's "
        "kinematics, two factors, "
        "and the flat film's capacitance. `DIR/NAME.lumped.toml` is the model to take away: plain "
        "SI numbers, with the "
        "formulas as a comment; `tympan lumped simulate --model` runs it. `make lumped-build` "
        "makes this page.", "",
        "## The kinematics", "", *_kinematics(circle), "",
        "## The paper's actuators, 0 to 5 kV, 17.9 and 22.45 g", "",
        "Fitted on 17.9 g at 0, 2.5 and 5 kV alone, the model is nowhere more than "
        f"{_percent(worst)} from the field "
        f"model's deflection at the {int((~circle.settings.fitted).sum())} other loads. Circles "
        "in the figure are the "
        "field model.", "",
        "![Deflection of field and lumped models, and what is left](lumped-build.png)", "",
        "Largest errors; deflection at loads that were not fitted, stroke from 0 to 5 kV and "
        "capacitance at all:", "",
        "| | | " + " | ".join(KINEMATICS) + " |", "|---|---|" + "---:|" * len(KINEMATICS),
        *(line for built in builds for line in _errors(built)), "",
        *_reading(builds), "",
        "## Shapes, electrodes, laws", "",
        "The same loads and fit. *Carried over*: the two factors are those of the circular "
        "actuator above, so of this "
        "specimen nothing but α was fitted.", "",
        "| | factors on film, voltage | scaled | membrane | carried over | corrected |",
        "|---|---|---:|---:|---:|---:|",
        *(_other(words, built, circle) for words, built in others), "",
        *_capacitances(others), "",
        "## Vibrations", "",
        "Undamped heave about rest under 17.9 g, from the model's stiffness and from the field "
        "model's eigenvalues, "
        "which the fit did not see:", "",
        "| | 0 kV: lumped, field | 5 kV: lumped, field |", "|---|---|---|",
        *(_heave(built) for built in builds), "",
        "## How far it reaches", "", *_reach(circle)]
    return "\n".join(lines) + "\n"


def _kinematics(circle: Built) -> list[str]:
    factor, = circle.model.circles.membrane_factor
    return [
        "*cone* is the paper's: the film is a straight cone. A film without bending stiffness is "
        "steeper at the plate. "
        "Under even tension, hardly deflected, its height is y ln(R/ρ)/ln(R/r), and its force "
        "l₀/(r ln(R/r)) times "
        f"the cone's: {factor:.3f} for the circle of 45 mm with a plate of 10 mm, "
        + " and ".join(f"{_factor(radius):.3f} for {1e3 * radius:g} mm"
                       for radius in (60e-3, 75e-3)) + ".", "",
        "*membrane* takes that shape. The energy of its slopes over the whole film is, to fourth "
        "order in y and for "
        "any law, that of a volume V with the one slope κy, with V κ² = 2π z₀/ln(R/r) and "
        "κ² = (1/r² − 1/R²)/(2 ln³(R/r)). Force is its derivative for film and voltage alike, so "
        "capacitance and force "
        "agree. Nothing is fitted but α.", "",
        "*corrected* has one factor on the film's energy and one on the voltage's, for what "
        "circles do not know: bare "
        "bands, plates or prestretches that are not round. *scaled* is the cone times the one "
        "factor that fits the "
        "first circle, with the α best for it.", "",
        "The viscous branch and damper stay the cone's in all of them: the paper identified their "
        "constants with it. "
        "A field model at rest says nothing about them."]


def _factor(radius: float) -> float:
    return (radius - 10e-3) / (10e-3 * np.log(radius / 10e-3))


def _errors(built: Built) -> Iterator[str]:
    rows = {"deflection": [built.worst(kind, held_out=True) for kind in KINEMATICS],
            "stroke": [built.stroke_error(kind) for kind in KINEMATICS],
            "capacitance": [built.capacitance_error(kind) for kind in KINEMATICS]}
    for what, values in rows.items():
        name = built.model.specimen.name if what == "deflection" else ""
        yield f"| {name} | {what} | " + " | ".join(map(_percent, values)) + " |"


def _reading(builds: Sequence[Built]) -> list[str]:
    circle, large = builds[0], builds[-1]
    return [
        f"The circle's cone sinks {circle.errors('cone')[0, 0] + 1:.2f} times as far as it "
        "should, and no α mends that "
        "in an ellipse: the best one puts all weight on the smaller circle. Its factor is wrong, "
        "not its "
        "shape: multiplied by one number it is as good in deflection as the membrane, with an α of "
        f"{large.alpha.by_basis['cone_scaled'].alpha[0]:.3f} for the large ellipse instead of the "
        f"{large.model.weights[0]:.3f} that membranes have. What the membrane adds: the number "
        "follows from the size "
        "of the circle, so the film's own law and permittivity serve as they are; α is that of "
        "circles of real film; "
        "and the capacitance is right, which the scaled cone has up to "
        f"{_percent(max(built.capacitance_error('scaled') or np.inf for built in builds))} wrong. "
        "(The share of the edge "
        f"force, {large.alpha.from_fields.alpha[0]:.3f} around the short axis of the large "
        "ellipse, is a third number "
        "and no weight for either.)"]


def _capacitances(others: Sequence[tuple[str, Built]]) -> list[str]:
    covered = [built.capacitance_error("corrected") or np.inf for _, built in others
               if built.model.specimen.electrode.everywhere]
    bare = [built.capacitance_error("corrected") or np.inf for _, built in others
            if not built.model.specimen.electrode.everywhere]
    return [f"Capacitance, corrected: within {_percent(max(covered))} "
            "where the whole film is covered. Where bands are "
            "bare, covered film spreads into them as the voltage rises, "
            f"without any deflection: {_percent(max(bare))} "
            "at 5 kV, which the lumped model does not have and `build` warns of."]


def _other(words: str, built: Built, circle: Built) -> str:
    carried = replace(built, model=replace(built.model, stiffness=circle.model.stiffness,
                                           permittivity=circle.model.permittivity))
    values = [*(built.worst(kind, held_out=True) for kind in ("scaled", "membrane")),
              carried.worst("corrected", held_out=True), built.worst("corrected", held_out=True)]
    model = built.model
    return (f"| {words} | {model.stiffness:.4f}, {model.permittivity:.4f} | "
            + " | ".join(map(_percent, values)) + " |")


def _heave(built: Built) -> str:
    pairs = zip(*(built.frequencies[name] for name in ("lumped", "field")), strict=True)
    return f"| {built.model.specimen.name} | " + " | ".join(f"{a:.4f}, {b:.4f} Hz"
                                                            for a, b in pairs) + " |"


def _reach(built: Built) -> list[str]:
    """How the error of a model built to 5 kV grows beyond."""
    voltages = (5.5e3, 6e3, 6.5e3, 7e3, 7.5e3)
    beyond = build(built.model.specimen, Settings(), replace(built.settings, voltages=voltages))
    errors = [rest_curve(built.actuator("corrected", mass), np.array(voltages)) / row - 1
              for mass, row in zip(built.settings.masses, beyond.field_deflection, strict=True)]
    ends = [tympan.limits(built.model.specimen, mass=mass).limits.instability
            for mass in built.settings.masses]
    return [
        "The circles keep their hoop stretch, so the model does not see what draws a film in. The "
        "circular actuator, "
        "built for 0 to 5 kV and asked beyond:", "",
        "| | " + " | ".join(f"{u / 1e3:g} kV" for u in voltages) + " |",
        "|---|" + "---:|" * len(voltages),
        *(f"| {1e3 * mass:g} g | " + " | ".join(f"{100 * error:+.2f} %" for error in row) + " |"
          for mass, row in zip(built.settings.masses, errors, strict=True)), "",
        "The field model loses tension and thins without bound at "
        + " and ".join(f"{1e-3 * end.voltage_V:.2f}" for end in ends if end) + " kV. "
        "A file therefore knows the highest voltage it was compared at, and `simulate --model` "
        "refuses more; `build` refuses voltages at which the field model has no "
        "equilibrium, with the voltage of that limit. The film's own mass is not in the model."]


def _percent(value: float | None) -> str:
    if value is None:
        return "pulls in"
    return f"{100 * value:.2g} %" if value < 0.1 else f"{100 * value:.0f} %"


if __name__ == "__main__":
    main()
