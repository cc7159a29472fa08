"""Table 1's Ogden constants lose stress with stretch where the actuators work."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from tympan.fem.film.laws import Separable
from tympan.studies.lumped.equilibria import rest
from tympan.studies.paper.published import HIGHEST, MASSES
from tympan.studies.paper.table1 import paper_actuators
from tympan.studies.replica.findings.finding import Evidence, Finding
from tympan.studies.replica.missing_parameters import MissingParameters
from tympan.studies.replica.words import sentences


def stress(stretch: float) -> tuple[float, float]:
    """Eq. (8) with Table 1's constants at a stretch from the mounted film [Pa], its derivative."""
    law = paper_actuators(1.0)[0].membrane.material
    assert isinstance(law, Separable)
    mounted = law.reference
    _, w1, _, w11, *_ = law.derivatives(mounted * stretch, mounted)
    # The true stress is λ dw/dλ.
    return mounted * stretch * w1, mounted * (w1 + mounted * stretch * w11)


def softening(missing: MissingParameters) -> Finding:
    """Stress and its slope at the mounted film, where it is zero, what the cone makes of it."""
    law = paper_actuators(1.0)[0].membrane.material
    assert isinstance(law, Separable)
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
    flatter = _constant_stress(float(circle.circles.steepness[0]) * 3e-3)
    words = sentences("law", stress_kPa=at / 1e3, slope_kPa=slope / 1e3,
                      parts_kPa=[part / 1e3 for part in parts], turns=turns, visited=max(visited),
                      loses=100 * (1 - second / first), constant_loses=100 * (1 - flatter))
    if abs(peaks) < 1e-3:
        words += sentences("law, maximum", y_mm=1e3 * float(largest.x),
                           mass_g=1e3 * -float(largest.fun) / circle.rig.gravity)
    numbers = [Evidence("stress at the mounted stretch", at, "Pa"),
               Evidence("its slope there", slope, "Pa"),
               *(Evidence(f"of it by i = {i}", part, "Pa")
                 for i, part in zip((1, 2, 3), parts, strict=True)),
               Evidence("stretch where the stress stops falling", turns),
               Evidence("largest stretch at 7 kV", float(max(visited))),
               Evidence("circle's stiffness at 3 mm over that when flat", second / first),
               Evidence("the same of a constant stress", flatter)]
    return Finding("law", "Table 1's Ogden set loses stress with stretch", words, tuple(numbers))


def _constant_stress(slope: float) -> float:
    """Stiffness over the flat cone's if true stress stays: force ∝ slope/(1 + slope²)."""
    return float((1 - slope**2) / (1 + slope**2) ** 2) if np.isfinite(slope) else float("nan")
