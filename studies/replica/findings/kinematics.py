"""A taut film is no cone: what the straight cone does to forces, and ½ C u² to the force of the voltage."""

from __future__ import annotations

import numpy as np

from tympan.fem.film.density import maxwell
from tympan.fem.film.library import DEFAULT, MATERIALS
from tympan.studies.circles.cone import ConeCircle
from tympan.studies.paper.published import NAMES
from tympan.studies.paper.table1 import paper_actuators
from tympan.studies.replica.findings.finding import Finding, Number
from tympan.studies.replica.findings.law import stress
from tympan.studies.replica.missing_parameters import MissingParameters

_TERMS, _POINTS = 14, 400


def membrane_stiffness(semi_axes: tuple[float, float], plate: float) -> float:
    """Stiffness over tension of a taut film between a round plate and an ellipse about it, hardly deflected [1].

    The deflection is harmonic: A ln(ρ/r) + Σ B_n ((ρ/r)^2n − (ρ/r)^−2n) cos 2nθ + 1, zero on the
    ellipse by least squares at 400 points; the stiffness is 2π|A|, for a circle 2π/ln(R/r).

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
    columns = (rho[:, None] ** powers - rho[:, None] **
               -powers.astype(float)) * np.cos(theta[:, None] * powers)
    matrix = np.column_stack([np.log(rho), columns / rho.max() ** powers])
    solved = np.linalg.lstsq(matrix, -np.ones(_POINTS), rcond=1e-14)[0]
    return float(-2 * np.pi * solved[0])


def cone_stiffness(radius: float, plate: float) -> float:
    """Stiffness over tension of the paper's cone, hardly deflected [1]: 2π r/(R − r)."""
    return 2 * np.pi * plate / (radius - plate)


def factors(missing: MissingParameters) -> list[float]:
    """Stiffness of the taut film over that of the paper's mixture of cones, of each actuator."""
    found = []
    for number, specimen in enumerate(paper_actuators(1.0)):
        a, b = specimen.frame.semi_axes
        plate = specimen.plate.outline.semi_axes[0]
        cones = [cone_stiffness(radius, plate) for radius in sorted({b, a})]
        mixed = sum(weight * cone for weight, cone in zip(missing.weights(number), cones, strict=True))
        found.append(membrane_stiffness((a, b), plate) / mixed)
    return found


def cone(missing: MissingParameters) -> Finding:
    """The factor of each actuator, and what it does to Table 1's stress and to ε_r."""
    found = factors(missing)
    prestretch = float(np.sqrt(paper_actuators(1.0)[0].membrane.area_prestretch))
    at = stress(1.0)[0]
    modulus = at / found[0] / (prestretch**2 - prestretch**-4)
    mounted = np.array(prestretch)
    tape = float(prestretch * MATERIALS[DEFAULT].material.derivatives(mounted, mounted)[1])
    return Finding(
        "cone", "A taut film is no straight cone",
        ("Hardly deflected, a film under tension T between radii r and R pulls with 2πT/ln(R/r) per deflection, the "
         f"cone of Eqs. (3) and (4) with 2πrT/(R − r): for the circle the film is {found[0]:.3f} times as stiff, for "
         f"the ellipses {found[1]:.3f} and {found[2]:.3f} times as stiff as the mixture of cones (their films by "
         "Laplace's equation).",
         f"The fit hides it in the constants: Table 1's {at / 1e3:.1f} kPa of prestress over {found[0]:.3f} is "
         f"{at / found[0] / 1e3:.1f} kPa, that of a neo-Hookean film of {modulus / 1e3:.1f} kPa at "
         f"{prestretch:.3f}; independent data on VHB 4910 ({DEFAULT} of the library) give {tape / 1e3:.1f} kPa. ε_r "
         f"{missing.permittivity:.2f} over it is {missing.permittivity / found[0]:.2f}, where the "
         "literature has 2.6 to 4.7. The constants of Table 1 are those of the cone, not of the tape."),
        (*(Number(f"taut film over cones, {name}", value)
           for name, value in zip(NAMES, found, strict=True)),
         Number("prestress of Table 1 over the circle's factor", at / found[0], "Pa"),
         Number("neo-Hookean modulus of that prestress", modulus, "Pa"),
         Number(f"prestress of the library's {DEFAULT}", tape, "Pa"),
         Number("relative permittivity over the circle's factor", missing.permittivity / found[0])))


def energy(missing: MissingParameters) -> Finding:
    """½ u² dC/dy of a cone against the force of the voltage in Eq. (5), of each circle."""
    circles = [ConeCircle(paper_actuators(missing.permittivity)[0], radius)
               for radius in (45e-3, 60e-3, 75e-3)]
    unit = maxwell(circles[0].specimen, 1.0)
    y, step = 3e-3, 1e-5
    slopes = [(circle.capacitance(y + step) - circle.capacitance(y - step)) / (2 * step)
              for circle in circles]
    found = [slope / 2 / -float(circle.pull(unit, y)[1]) for circle, slope in zip(circles, slopes,
                                                                                  strict=True)]
    closed = [(circle.radius + circle.plate_radius) / (2 * circle.plate_radius)
              for circle in circles]
    flat = [circle.capacitance(0.0) for circle in circles]
    return Finding(
        "energy", "½ C u² is not the energy of Eq. (5)",
        ("Section 2 argues with E = ½ C u²; its derivative by y is the force of the voltage on the whole film. Eq. "
         "(5) takes the Maxwell stress at the plate's edge alone. On the same cone the first is "
         + ", ".join(f"{value:.3f}" for value in found)
         + " times the second for circles of 45, 60 and 75 mm: "
         "(r_j + r)/(2r). The cone's stress, the same everywhere, is not in equilibrium along the radius, so the "
         "two need not agree. In one circle the elastic force has the same factor, which its ranges therefore do "
         "not show; in a mixture each circle has its own.",
         "Nor does the larger capacitance of an ellipse say that it moves further, for what moves the plate is "
         f"dC/dy: a circle of 75 mm has {flat[2] / flat[0]:.2f} times the capacitance of one of 45 mm, and at the "
         f"same y only {slopes[2] / slopes[0]:.2f} times the force of the voltage. It moves further because it is "
         "softer."),
        (*(Number(f"dC/dy force over Eq. (5), {1e3 * circle.radius:g} mm", value)
           for circle, value in zip(circles, found, strict=True)),
         *(Number(f"(r_j + r)/(2r), {1e3 * circle.radius:g} mm", value)
           for circle, value in zip(circles, closed, strict=True)),
         Number("flat capacitance, 75 mm over 45 mm", flat[2] / flat[0]),
         Number("dC/dy at 3 mm, 75 mm over 45 mm", slopes[2] / slopes[0])))


