"""Table 1's Ogden constants lose stress with stretch where the actuators work."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from tympan.fem.film.laws import Separable
from tympan.studies.lumped.equilibria import rest
from tympan.studies.paper.published import HIGHEST, MASSES
from tympan.studies.paper.table1 import paper_actuators
from tympan.studies.replica.findings.finding import Finding, Number
from tympan.studies.replica.missing_parameters import MissingParameters


def stress(stretch: float) -> tuple[float, float]:
    """Eq. (8) with Table 1's constants at a stretch from the mounted film [Pa], and its derivative."""
    law = paper_actuators(1.0)[0].membrane.material
    assert isinstance(law, Separable)
    mounted = law.reference
    _, w1, _, w11, *_ = law.derivatives(mounted * stretch, mounted)
    # The true stress is λ dw/dλ.
    return mounted * stretch * w1, mounted * (w1 + mounted * stretch * w11)


def softening(missing: MissingParameters) -> Finding:
    """Stress and its slope at the mounted film, where the slope is zero, what the cone makes of it."""
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
    words = [
        f"At the mounted film Eq. (8) gives {at / 1e3:.1f} kPa and dσ/dλ = Σ 2i (β_i + γ_i) = {slope / 1e3:.1f} kPa: "
        f"{parts[0] / 1e3:+.1f}, {parts[1] / 1e3:+.1f} and {parts[2] / 1e3:+.1f} kPa of i = 1, 2, 3. The stress "
        f"falls with stretch up to λ = {turns:.4f}; at the paper's loads the film reaches {max(visited):.4f} at most.",
        "A negative γ is a term that pulls less the more it is stretched; γ₂ alone outweighs the rest. The cone of "
        f"the circle loses {100 * (1 - second / first):.1f} % of its stiffness from flat to 3 mm; that of a constant "
        "stress would lose "
        f"{100 * (1 - _constant_stress(float(circle.circles.steepness[0]) * 3e-3)):.1f} %."]
    if abs(peaks) < 1e-3:
        words.append(f"Its force has a maximum at {1e3 * float(largest.x):.1f} mm: it holds "
                     f"{1e3 * -float(largest.fun) / circle.rig.gravity:.1f} g and no more.")
    numbers = [Number("stress at the mounted stretch", at, "Pa"),
               Number("its slope there", slope, "Pa"),
               *(Number(f"of it by i = {i}", part, "Pa")
                 for i, part in zip((1, 2, 3), parts, strict=True)),
               Number("stretch where the stress stops falling", turns),
               Number("largest stretch at 7 kV", float(max(visited))),
               Number("circle's stiffness at 3 mm over that when flat", second / first),
               Number("the same of a constant stress",
                      _constant_stress(float(circle.circles.steepness[0]) * 3e-3))]
    return Finding("law", "Table 1's Ogden set loses stress with stretch", tuple(words),
                   tuple(numbers))


def _constant_stress(slope: float) -> float:
    """Stiffness over that when flat of a cone whose true stress stays: force ∝ slope/(1 + slope²)."""
    return float((1 - slope**2) / (1 + slope**2) ** 2) if np.isfinite(slope) else float("nan")
