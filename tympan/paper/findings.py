"""Faults and gaps of the paper, each shown by a computation.

Every function computes one finding's values; ``words.txt`` explains them, ``findings.toml`` selects
the numbers that are stored.
"""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources
from string import Formatter
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from tympan.base.arrays import Array
from tympan.fem.film.density import maxwell
from tympan.fem.film.laws import Separable
from tympan.fem.film.library import DEFAULT, MATERIALS
from tympan.geometry.outlines import area
from tympan.paper import published
from tympan.paper.figures import Replica
from tympan.paper.missing_parameters import (
    MissingParameters,
    allowed,
    deflections,
    other_fits,
    rest_ranges,
    smallest_worst,
)
from tympan.paper.published import MASSES, NAMES, ranges
from tympan.paper.table1 import known, paper_actuators
from tympan.studies.circles import ConeCircle
from tympan.studies.identify.static import StaticProblem
from tympan.studies.lumped.actuator import paper_cones
from tympan.studies.lumped.equilibria import rest
from tympan.studies.lumped.linear import linearise

Values = dict[str, Any]
_VOLTAGES = np.linspace(published.LOWEST, published.HIGHEST, 15)
#: Scales of the six constants of Eq. (8) [Pa] and of ε_r.
_SIZES = np.array([*[50e3] * 6, 5.0])

#: Number of terms of the series around the plate. Set by trial.
_TERMS = 14
#: Number of points on a quarter of the ellipse for its least squares, many for each term.
_POINTS = 400

#: Largest difference of two growths that the rounding of ranges to 0.01 mm can make.
_ALIKE = 0.03


def findings(replica: Replica) -> list[dict[str, Any]]:
    """List all findings as stored: ``key``, ``title``, ``words``, and their ``numbers``."""
    missing = replica.missing
    shown = {"sign": sign(missing), "law": softening(missing), "cone": cone(missing),
             "lost": lost_cells(replica), "mass": mass_ratio(replica),
             "energy": energy(missing), "checks": checks()}
    text = resources.files("tympan.paper").joinpath("findings.toml")
    stated = tomllib.loads(text.read_text(encoding="utf-8"))
    return [{"key": key, "title": stated[key]["title"],
             "words": [words for words in sentences(key, **values) if words],
             "numbers": [{"what": what.format(**values), "unit": unit,
                          "value": float(Formatter().get_field(path, (), values)[0])}
                         for what, path, unit in stated[key]["numbers"]]}
            for key, values in shown.items()]


def sentences(key: str, **values: Any) -> list[str]:
    """Fill the paragraphs of a section; values may have attributes and indices."""
    return [paragraph.format(**values) for paragraph in _sections()[key]]


@cache
def _sections() -> dict[str, list[str]]:
    """Read words.txt: paragraphs, each on one line, by the ``[key]`` of their section."""
    text = resources.files("tympan.paper").joinpath("words.txt")
    sections: dict[str, list[str]] = {}
    for block in text.read_text(encoding="utf-8").strip().split("\n\n"):
        first, *lines = block.splitlines()
        if first.startswith("["):
            paragraphs = sections[first.strip("[]")] = []
        else:
            lines = [first, *lines]
        if lines:
            paragraphs.append(" ".join(lines))
    return sections


def _law() -> Separable:
    law = paper_actuators(1.0)[0].membrane.material
    assert isinstance(law, Separable)
    return law


def stress(stretch: float) -> tuple[float, float]:
    """Compute Eq. (8) with Table 1's constants at a stretch [Pa], and its derivative."""
    law = _law()
    mounted = law.reference
    _, w1, _, w11, *_ = law.derivatives(mounted * stretch, mounted)
    # The true stress is λ dw/dλ.
    return mounted * stretch * w1, mounted * (w1 + mounted * stretch * w11)


def softening(missing: MissingParameters) -> Values:
    """Compute stress of the mounted film, its slope and zero, and the softening of the cone."""
    law = _law()
    at, slope = stress(1.0)
    parts = [2 * i * (beta + gamma) for i, beta, gamma in zip((1, 2, 3), law.beta, law.gamma,
                                                              strict=True)]
    circle = missing.actuators(MASSES[0])[0]
    first, second = (float(circle.elastic(y)[2]) for y in (1e-6, 3e-3))
    largest = minimize_scalar(lambda y: -float(circle.elastic(y)[1]),
                              bounds=(1e-3, circle.reach / 3), method="bounded",
                              options={"xatol": 1e-9})
    maximum = ""
    if abs(float(circle.elastic(largest.x)[2]) / first) < 1e-3:
        maximum, = sentences("law, maximum", y_mm=1e3 * float(largest.x),
                             mass_g=1e3 * -float(largest.fun) / circle.rig.gravity)
    visited = [actuator.circles.stretch(rest(actuator, published.HIGHEST))[0].max()
               for mass in MASSES for actuator in missing.actuators(mass)]
    steep = float(circle.circles.steepness[0]) * 3e-3
    flatter = (1 - steep**2) / (1 + steep**2) ** 2  # for constant true stress: force ∝ s/(1 + s²)
    return {"stress": at, "slope": slope, "parts": parts, "stress_kPa": at / 1e3,
            "slope_kPa": slope / 1e3, "parts_kPa": [part / 1e3 for part in parts],
            "turns": brentq(lambda x: stress(x)[1], 1.0, 1.5, xtol=1e-12),
            "visited": max(visited), "left": second / first, "constant_left": flatter,
            "loses": 100 * (1 - second / first), "constant_loses": 100 * (1 - flatter),
            "maximum": maximum}


def at_rest(missing: MissingParameters) -> tuple[Array, Array, Array]:
    """Evaluate Eq. (11) on the model's own equilibria, which are data without errors.

    Return the force per unit of β₁…β₃, γ₁…γ₃ and ε_r, shape (readings, 7), these constants, and the
    weights [N].
    """
    specimens = paper_actuators(missing.permittivity)
    rests = deflections(missing.permittivity, missing.alpha, _VOLTAGES[:, None, None])
    voltage, mass, which = (axis.ravel() for axis in np.meshgrid(
        _VOLTAGES, MASSES, np.arange(3), indexing="ij"))
    problem = StaticProblem(paper_cones(specimens), which, mass, voltage, rests.ravel())
    law = _law()
    values = np.array([*law.beta, *law.gamma, missing.permittivity, *missing.alpha])
    return problem.force(values, problem.read)[2][:, :7], values[:7], problem.load


def sign(missing: MissingParameters) -> Values:
    """Compute Eq. (11)'s residual in equilibrium and best fit, with the right and printed sign.

    The right sign is that of Eq. (5).
    """
    columns, constants, load = at_rest(missing)
    force = columns @ constants
    searched = [_SIZES * np.linalg.lstsq(direction * columns * _SIZES, load, rcond=1e-10)[0]
                for direction in (1.0, -1.0)]
    stresses = [float(values[:3].sum() - values[3:6].sum()) for values in searched]
    return {"printed": np.abs((load + force) / load).max(),
            "right": np.abs((load - force) / load).max(), "stress": stresses,
            "stress_kPa": stresses[1] / 1e3, "permittivity": [values[6] for values in searched]}


def membrane_stiffness(semi_axes: tuple[float, float], plate: float) -> float:
    """Compute stiffness over tension [1] of a taut film between a round plate and an ellipse.

    A small deflection is harmonic: A ln(ρ/r) + Σ B_n ((ρ/r)^2n − (ρ/r)^−2n) cos 2nθ + 1. It is made
    zero on the ellipse by least squares at 400 points. The stiffness is 2π|A|; for a circle that is
    2π/ln(R/r).
    """
    a, b = semi_axes
    theta = (np.arange(_POINTS) + 0.5) * np.pi / 2 / _POINTS
    rho = a * b / np.hypot(b * np.cos(theta), a * np.sin(theta)) / plate
    powers = 2 * np.arange(1, _TERMS + 1)
    # Columns are scaled to one size: (ρ/r)^28 would outweigh all others.
    radial = rho[:, None] ** powers - rho[:, None] ** -powers.astype(float)
    columns = radial * np.cos(theta[:, None] * powers)
    matrix = np.column_stack([np.log(rho), columns / rho.max() ** powers])
    solved = np.linalg.lstsq(matrix, -np.ones(_POINTS), rcond=1e-14)[0]
    return float(-2 * np.pi * solved[0])


def factors(missing: MissingParameters) -> list[float]:
    """Compute stiffness of the taut film over that of the paper's mixture of cones, by actuator."""
    stiffer = []
    for column, specimen in enumerate(paper_actuators(1.0)):
        a, b = specimen.frame.semi_axes
        plate = specimen.needed_plate().outline.semi_axes[0]
        cones = [2 * np.pi * plate / (radius - plate) for radius in sorted({b, a})]
        mixed = sum(weight * cone
                    for weight, cone in zip(missing.weights(column), cones, strict=True))
        stiffer.append(membrane_stiffness((a, b), plate) / mixed)
    return stiffer


def cone(missing: MissingParameters) -> Values:
    """Compute the changes of Table 1's stress and ε_r by :func:`factors`."""
    stiffer = factors(missing)
    prestretch = float(np.sqrt(paper_actuators(1.0)[0].membrane.area_prestretch))
    at = stress(1.0)[0]
    modulus = at / stiffer[0] / (prestretch**2 - prestretch**-4)
    mounted = np.array(prestretch)
    tape = float(prestretch * MATERIALS[DEFAULT].material.derivatives(mounted, mounted)[1])
    return {"stiffer": stiffer, "prestress": at / stiffer[0], "modulus": modulus, "tape": tape,
            "over": missing.permittivity / stiffer[0], "permittivity": missing.permittivity,
            "prestretch": prestretch, "library": DEFAULT, "table_kPa": at / 1e3,
            "over_kPa": at / stiffer[0] / 1e3, "modulus_kPa": modulus / 1e3,
            "tape_kPa": tape / 1e3}


def energy(missing: MissingParameters) -> Values:
    """Compare ½ u² dC/dy of each cone with the force of the voltage in Eq. (5)."""
    circles = [ConeCircle(paper_actuators(missing.permittivity)[0], radius)
               for radius in (45e-3, 60e-3, 75e-3)]
    unit = maxwell(circles[0].specimen, 1.0)
    y, step = 3e-3, 1e-5
    slopes = [(circle.capacitance(y + step) - circle.capacitance(y - step)) / (2 * step)
              for circle in circles]
    flat = [circle.capacitance(0.0) for circle in circles]
    return {"times": [slope / 2 / -float(circle.pull(unit, y)[1])
                      for circle, slope in zip(circles, slopes, strict=True)],
            "closed": [(circle.radius + circle.plate_radius) / (2 * circle.plate_radius)
                       for circle in circles],
            "capacitances": flat[2] / flat[0], "slopes": slopes[2] / slopes[0]}


def checks() -> Values:
    """Check electrode surfaces, percentages of Table 2, and what the prestretch factor means."""
    actuators = paper_actuators(1.0)
    surfaces = np.array([area(film.frame) - film.plate_area
                         for film in actuators])
    off = np.abs(surfaces - published.SURFACES).max()
    read, half = ranges(), published.ROUNDING
    shares = 100 * read / read[:, :1]
    far = np.argwhere(np.round(shares) != published.PERCENTAGES)
    row, column = far[0]
    return {"surfaces": surfaces, "surfaces_cm2": 1e4 * surfaces, "off": off, "off_cm2": 1e4 * off,
            "shares": shares, "count": len(far), "name": NAMES[column],
            "mass_g": 1e3 * MASSES[row], "share": shares[row, column],
            "printed": published.PERCENTAGES[row, column],
            "largest": 100 * (read[row, column] + half) / (read[row, 0] - half),
            "thickness": known("z_ini") / known("z_0"), "thinnest_um": 1e6 * known("z_ini") / 25,
            "stretch": np.sqrt(actuators[0].membrane.area_prestretch)}


def lost_cells(replica: Replica) -> Values:
    """Fit the lost cells in equilibrium and at the ends of levels, with limits."""
    each, light, heavy = other_fits().values()
    best, levels, limits = smallest_worst(), replica.fits["levels"], allowed()
    ellipses = np.abs(levels.misfit[:, 1:]).max()
    return {"rest": replica.fits["rest"], "best": best, "levels": levels, "each": each,
            "light": light, "heavy": heavy, "permittivity": limits["relative_permittivity"],
            "alpha": limits["alpha_1"], "rounding_mm": 1e3 * published.ROUNDING,
            "times": best.worst / published.ROUNDING, "ellipses": ellipses,
            "ellipses_mm": 1e3 * ellipses, "circle_mm": 1e3 * levels.misfit[:, 0]}


def smallest_growth(permittivities: Array, alphas: Array, voltages: Array) -> Array:
    """Find the smallest ratio of equilibrium ranges under the two masses, by actuator.

    All values of ε_r, α₁ and the upper voltage [V] are tried.
    """
    grid, alpha = np.meshgrid(permittivities, alphas, indexing="ij")
    growths = []
    for voltage in voltages:
        light, heavy = np.moveaxis(rest_ranges(grid, np.stack([alpha, alpha], -1), voltage), -2, 0)
        growths.append(np.nanmin(heavy / light, axis=(0, 1)))
    return np.asarray(np.min(growths, axis=0))


def unaccounted(missing: MissingParameters, growth: Array) -> Array:
    """Find the mass [kg] to be added to the stated one to explain the growth, by actuator."""
    def extra(column: int, target: float) -> float:
        def moved(row: int, extra: float, permittivity: float) -> float:
            ours = rest_ranges(permittivity, missing.alpha, masses=(MASSES[row] + extra,))
            return float(np.nan_to_num(ours[0, column], nan=1.0))

        def miss(extra: float) -> float:
            # ε_r is chosen so that the range under the smaller mass does not change.
            permittivity = float(brentq(lambda value: moved(0, extra, value) - target, 1.0, 9.9,
                                        xtol=1e-9))
            return float(moved(1, extra, permittivity) / target - growth[column])

        return float(brentq(miss, 0.0, 0.2, xtol=1e-7))

    return np.array([extra(*each) for each in enumerate(ranges()[0].tolist())])


def mass_ratio(replica: Replica) -> Values:
    """Compute growth of ranges with mass: in Table 2, equilibria at any ε_r and α, over steps."""
    growth, at_rest, at_ends, moving = (heavy / light for light, heavy in (
        ranges(), replica.rest_ranges, replica.level_ranges, replica.random_ranges))
    least = smallest_growth(np.linspace(1.0, 11.0, 41), np.linspace(0.0, 1.0, 11),
                            np.array([1e3, 4e3, published.HIGHEST]))
    extra = unaccounted(replica.missing, growth)
    # Share of the slowest motion that remains when figure 14 switches, about each equilibrium.
    remaining = [float(np.exp(-np.abs(linearise(actuator, volts).poles[0]) * published.SWITCH))
                 for volts in (published.STEP[1], published.HIGHEST)
                 for mass in MASSES for actuator in replica.missing.actuators(mass)]
    alike = (np.abs(at_ends - growth) < _ALIKE).tolist()
    odd = " " + sentences("mass, odd")[0] if alike == [False, True, True] else ""
    masses = MASSES[1] / MASSES[0]
    return {"masses": masses, "growth": growth, "at_rest": at_rest, "least": least,
            "smallest": least.min(), "at_ends": at_ends, "moving": moving, "extra": extra,
            "extra_g": 1e3 * extra, "cubic": masses ** (1 / 3),
            "remaining": (min(remaining), max(remaining)),
            "remaining_percent": (100 * min(remaining), 100 * max(remaining)), "odd": odd}
