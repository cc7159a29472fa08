"""What the paper's equations and tables say themselves: Eq. (8)'s law, Eq. (11)'s signs, sums."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from tympan.fem.film.laws import Separable
from tympan.fem.rig import Rig
from tympan.geometry.outlines import area
from tympan.studies.identify.static import StaticProblem
from tympan.studies.lumped.equilibria import rest
from tympan.studies.paper.published import (
    HIGHEST,
    MASSES,
    NAMES,
    PERCENTAGES,
    ROUNDING,
    SURFACES,
    ranges,
)
from tympan.studies.paper.table1 import known, paper_actuators
from tympan.studies.replica.findings.finding import Finding, evidence
from tympan.studies.replica.missing_parameters import MissingParameters, deflections
from tympan.studies.replica.words import sentences

Array = NDArray[np.float64]
_VOLTAGES = np.linspace(0.0, 7e3, 15)
_SIZES = np.array([*[50e3] * 6, 5.0])


def _law() -> Separable:
    law = paper_actuators(1.0)[0].membrane.material
    assert isinstance(law, Separable)
    return law


def stress(stretch: float) -> tuple[float, float]:
    """Eq. (8) with Table 1's constants at a stretch from the mounted film [Pa], its derivative."""
    law = _law()
    mounted = law.reference
    _, w1, _, w11, *_ = law.derivatives(mounted * stretch, mounted)
    # The true stress is λ dw/dλ.
    return mounted * stretch * w1, mounted * (w1 + mounted * stretch * w11)


def softening(missing: MissingParameters) -> Finding:
    """Stress and its slope at the mounted film, where it is zero, what the cone makes of it."""
    law = _law()
    at, slope = stress(1.0)
    turns = float(brentq(lambda x: stress(x)[1], 1.0, 1.5, xtol=1e-12))
    parts = [2 * i * (beta + gamma) for i, beta, gamma in zip((1, 2, 3), law.beta, law.gamma,
                                                              strict=True)]
    circle = missing.actuators(MASSES[0])[0]
    first, second = (float(circle.elastic(y)[2]) for y in (1e-6, 3e-3))
    largest = minimize_scalar(lambda y: -float(circle.elastic(y)[1]),
                              bounds=(1e-3, circle.reach / 3), method="bounded",
                              options={"xatol": 1e-9})
    peaks = float(circle.elastic(largest.x)[2]) / first
    visited = [actuator.circles.stretch(rest(actuator, HIGHEST))[0].max()
               for mass in MASSES for actuator in missing.actuators(mass)]
    steep = float(circle.circles.steepness[0]) * 3e-3
    flatter = (1 - steep**2) / (1 + steep**2) ** 2  # if true stress stays: force ∝ s/(1 + s²)
    words = sentences("law", stress_kPa=at / 1e3, slope_kPa=slope / 1e3,
                      parts_kPa=[part / 1e3 for part in parts], turns=turns, visited=max(visited),
                      loses=100 * (1 - second / first), constant_loses=100 * (1 - flatter))
    if abs(peaks) < 1e-3:
        words += sentences("law, maximum", y_mm=1e3 * float(largest.x),
                           mass_g=1e3 * -float(largest.fun) / circle.rig.gravity)
    numbers = [evidence("stress at the mounted stretch", at, "Pa"),
               evidence("its slope there", slope, "Pa"),
               *(evidence(f"of it by i = {i}", part, "Pa")
                 for i, part in zip((1, 2, 3), parts, strict=True)),
               evidence("stretch where the stress stops falling", turns),
               evidence("largest stretch at 7 kV", float(max(visited))),
               evidence("circle's stiffness at 3 mm over that when flat", second / first),
               evidence("the same of a constant stress", flatter)]
    return Finding("law", "Table 1's Ogden set loses stress with stretch", words, tuple(numbers))


def at_rest(missing: MissingParameters) -> tuple[Array, Array, Array]:
    """Eq. (11) at the model's own rests, which are data without an error.

    Force per unit of β₁…β₃, γ₁…γ₃ and ε_r, shape (readings, 7), these constants, and weights [N].
    """
    specimens = paper_actuators(missing.permittivity)
    rests = deflections(missing.permittivity, missing.alpha, _VOLTAGES[:, None, None])
    voltage, mass, which = (axis.ravel() for axis in np.meshgrid(
        _VOLTAGES, MASSES, np.arange(3), indexing="ij"))
    problem = StaticProblem(specimens, Rig(), which, mass, voltage, rests.ravel())
    law = _law()
    values = np.array([*law.beta, *law.gamma, missing.permittivity, *missing.alpha])
    return problem.force(values, problem.read)[2][:, :7], values[:7], problem.load


def sign(missing: MissingParameters) -> Finding:
    """The residual of Eq. (11) at rest with both signs, and what the search finds with both."""
    columns, constants, load = at_rest(missing)
    force = columns @ constants
    printed, right = load + force, load - force
    searched = {}
    for name, direction in (("as Eq. (5)", 1.0), ("as printed", -1.0)):
        values = _SIZES * np.linalg.lstsq(direction * columns * _SIZES, load, rcond=1e-10)[0]
        searched[name] = (float(values[:3].sum() - values[3:6].sum()), float(values[6]))
    stress, permittivity = searched["as printed"]
    return Finding(
        "sign", "Eq. (11) has the signs of Eq. (5) reversed",
        sentences("sign", printed=np.abs(printed / load).max(), right=np.abs(right / load).max(),
                  stress_kPa=stress / 1e3, permittivity=permittivity),
        (evidence("residual over weight, as printed", float(np.abs(printed / load).max())),
         evidence("residual over weight, signs of Eq. (5)", float(np.abs(right / load).max())),
         *(evidence(f"stress at the mounted stretch found, {name}", value[0], "Pa")
           for name, value in searched.items()),
         *(evidence(f"relative permittivity found, {name}", value[1])
           for name, value in searched.items())))


def checks() -> Finding:
    """Electrode surfaces, percentages of Table 2, and what the prestretch factor means."""
    actuators = paper_actuators(1.0)
    surfaces = [area(film.frame) - area(film.plate.outline) for film in actuators]
    off = float(np.abs(np.array(surfaces) - SURFACES).max())
    read = ranges()
    shares = 100 * read / read[:, :1]
    far = [(row, column) for row in range(2) for column in range(3)
           if round(float(shares[row, column])) != PERCENTAGES[row, column]]
    row, column = far[0]
    largest = 100 * (read[row, column] + ROUNDING) / (read[row, 0] - ROUNDING)
    thickness = known("z_ini") / known("z_0")
    stretch = float(np.sqrt(actuators[0].membrane.area_prestretch))
    return Finding(
        "checks", "Smaller things, checked",
        sentences("checks", surfaces=", ".join(f"{1e4 * value:.2f}" for value in surfaces),
                  off_cm2=1e4 * off, count=len(far), name=NAMES[column],
                  mass_g=1e3 * MASSES[row], share=shares[row, column],
                  printed=PERCENTAGES[row, column], largest=largest, thickness=thickness,
                  stretch=stretch, thinnest_um=1e6 * known("z_ini") / 25),
        (*(evidence(f"film's surface, {name}", value, "m²")
           for name, value in zip(NAMES, surfaces, strict=True)),
         evidence("largest difference from Table 1", off, "m²"),
         *(evidence(f"percentage from the ranges, {name}, {1e3 * mass:g} g",
                    float(shares[r, c]), "%")
           for r, mass in enumerate(MASSES) for c, name in enumerate(NAMES)),
         evidence("percentages that do not follow", float(len(far))),
         evidence("thickness ratio", thickness), evidence("stretch along each axis", stretch)))
