"""A taut film is no cone: what cones do to forces, and ½ C u² to the force of the voltage."""

from __future__ import annotations

import numpy as np

from tympan.fem.film.density import maxwell
from tympan.fem.film.library import DEFAULT, MATERIALS
from tympan.studies.circles.cone import ConeCircle
from tympan.studies.paper.published import NAMES
from tympan.studies.paper.table1 import paper_actuators
from tympan.studies.replica.findings.equations import stress
from tympan.studies.replica.findings.finding import Finding, evidence
from tympan.studies.replica.missing_parameters import MissingParameters
from tympan.studies.replica.words import sentences

_TERMS, _POINTS = 14, 400


def membrane_stiffness(semi_axes: tuple[float, float], plate: float) -> float:
    """Stiffness over tension of a taut film between a round plate and an ellipse about it [1].

    Hardly deflected. The deflection is harmonic: A ln(ρ/r) + Σ B_n ((ρ/r)^2n − (ρ/r)^−2n) cos 2nθ
    + 1, zero on the ellipse by least squares at 400 points; the stiffness is 2π|A|, for a circle
    2π/ln(R/r).

    Examples
    --------
    >>> float(round(membrane_stiffness((45e-3, 45e-3), 10e-3) * np.log(4.5) / (2 * np.pi), 12))
    1.0
    """
    a, b = semi_axes
    theta = (np.arange(_POINTS) + 0.5) * np.pi / 2 / _POINTS
    rho = a * b / np.hypot(b * np.cos(theta), a * np.sin(theta)) / plate
    powers = 2 * np.arange(1, _TERMS + 1)
    # Each column in its own size: (ρ/r)^28 would drown the others.
    radial = rho[:, None] ** powers - rho[:, None] ** -powers.astype(float)
    columns = radial * np.cos(theta[:, None] * powers)
    matrix = np.column_stack([np.log(rho), columns / rho.max() ** powers])
    solved = np.linalg.lstsq(matrix, -np.ones(_POINTS), rcond=1e-14)[0]
    return float(-2 * np.pi * solved[0])


def cone_stiffness(radius: float, plate: float) -> float:
    """Stiffness over tension of the paper's cone, hardly deflected [1]: 2π r/(R − r)."""
    return 2 * np.pi * plate / (radius - plate)


def factors(missing: MissingParameters) -> list[float]:
    """Stiffness of the taut film over that of the paper's mixture of cones, of each actuator."""
    stiffer = []
    for column, specimen in enumerate(paper_actuators(1.0)):
        a, b = specimen.frame.semi_axes
        plate = specimen.plate.outline.semi_axes[0]
        cones = [cone_stiffness(radius, plate) for radius in sorted({b, a})]
        mixed = sum(weight * cone
                    for weight, cone in zip(missing.weights(column), cones, strict=True))
        stiffer.append(membrane_stiffness((a, b), plate) / mixed)
    return stiffer


def cone(missing: MissingParameters) -> Finding:
    """The factor of each actuator, and what it does to Table 1's stress and to ε_r."""
    stiffer = factors(missing)
    prestretch = float(np.sqrt(paper_actuators(1.0)[0].membrane.area_prestretch))
    at = stress(1.0)[0]
    modulus = at / stiffer[0] / (prestretch**2 - prestretch**-4)
    mounted = np.array(prestretch)
    tape = float(prestretch * MATERIALS[DEFAULT].material.derivatives(mounted, mounted)[1])
    return Finding(
        "cone", "A taut film is no straight cone",
        sentences("cone", stiffer=stiffer, table_kPa=at / 1e3, over_kPa=at / stiffer[0] / 1e3,
                  modulus_kPa=modulus / 1e3, prestretch=prestretch, library=DEFAULT,
                  tape_kPa=tape / 1e3, permittivity=missing.permittivity,
                  over=missing.permittivity / stiffer[0]),
        (*(evidence(f"taut film over cones, {name}", value)
           for name, value in zip(NAMES, stiffer, strict=True)),
         evidence("prestress of Table 1 over the circle's factor", at / stiffer[0], "Pa"),
         evidence("neo-Hookean modulus of that prestress", modulus, "Pa"),
         evidence(f"prestress of the library's {DEFAULT}", tape, "Pa"),
         evidence("relative permittivity over the circle's factor",
                  missing.permittivity / stiffer[0])))


def energy(missing: MissingParameters) -> Finding:
    """½ u² dC/dy of a cone against the force of the voltage in Eq. (5), of each circle."""
    circles = [ConeCircle(paper_actuators(missing.permittivity)[0], radius)
               for radius in (45e-3, 60e-3, 75e-3)]
    unit = maxwell(circles[0].specimen, 1.0)
    y, step = 3e-3, 1e-5
    slopes = [(circle.capacitance(y + step) - circle.capacitance(y - step)) / (2 * step)
              for circle in circles]
    times = [slope / 2 / -float(circle.pull(unit, y)[1])
             for circle, slope in zip(circles, slopes, strict=True)]
    closed = [(circle.radius + circle.plate_radius) / (2 * circle.plate_radius)
              for circle in circles]
    flat = [circle.capacitance(0.0) for circle in circles]
    return Finding(
        "energy", "½ C u² is not the energy of Eq. (5)",
        sentences("energy", times=times, capacitances=flat[2] / flat[0],
                  slopes=slopes[2] / slopes[0]),
        (*(evidence(f"dC/dy force over Eq. (5), {1e3 * circle.radius:g} mm", value)
           for circle, value in zip(circles, times, strict=True)),
         *(evidence(f"(r_j + r)/(2r), {1e3 * circle.radius:g} mm", value)
           for circle, value in zip(circles, closed, strict=True)),
         evidence("flat capacitance, 75 mm over 45 mm", flat[2] / flat[0]),
         evidence("dC/dy at 3 mm, 75 mm over 45 mm", slopes[2] / slopes[0])))


