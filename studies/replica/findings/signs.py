"""Eq. (11) as printed asks the film to push down with the weight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.density import maxwell
from tympan.fem.film.laws import Separable
from tympan.studies.circles.cone import ConeCircle
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import rest
from tympan.studies.paper.published import MASSES
from tympan.studies.paper.table1 import paper_actuators
from tympan.studies.replica.findings.finding import Finding, Number
from tympan.studies.replica.missing_parameters import Lost

Array = NDArray[np.float64]
_VOLTAGES = np.linspace(0.0, 7e3, 15)
_POWERS = (1, 2, 3)
_SIZES = np.array([*[50e3] * 6, 5.0])


def forces(actuator: Actuator, y: Array, voltage: Array) -> Array:
    """The film's force [N] at deflections [m] and voltages [V] per unit of β₁…β₃, γ₁…γ₃ and ε_r, shape (points, 7).

    Eq. (11) is linear in all of them once the weights are given.
    """
    film = actuator.specimen.membrane
    laws = [Separable((float(one == "beta"),), (float(one == "gamma"),), (2.0 * power,),
                      film.area_prestretch**0.5)
            for one in ("beta", "gamma") for power in _POWERS]
    unit = maxwell(paper_actuators(1.0)[0], 1.0)
    total = np.zeros((len(y), 7))
    for weight, circle in zip(actuator.weights, actuator.circles, strict=True):
        assert isinstance(circle, ConeCircle)
        columns = [circle.pull(law, y)[1] for law in laws]
        total += weight * np.array([*columns, voltage**2 * circle.pull(unit, y)[1]]).T
    return total


def at_rest(lost: Lost) -> tuple[Array, Array]:
    """Forces per constant, shape (readings, 7), and weights [N] at the model's own rests: data without an error."""
    rows, loads = [], []
    for mass in MASSES:
        for actuator in lost.actuators(mass):
            y = np.array([rest(actuator, float(volts)).deflection for volts in _VOLTAGES])
            rows.append(forces(actuator, y, _VOLTAGES))
            loads.append(np.full(len(y), actuator.load))
    return np.vstack(rows), np.concatenate(loads)


def constants(lost: Lost) -> Array:
    """β₁…β₃, γ₁…γ₃ [Pa] of Table 1 and ε_r."""
    law = paper_actuators(lost.permittivity)[0].membrane.material
    assert isinstance(law, Separable)
    return np.array([*law.beta, *law.gamma, lost.permittivity])


def sign(lost: Lost) -> Finding:
    """The residual of Eq. (11) at rest with both signs, and what the search finds with both."""
    columns, load = at_rest(lost)
    force = columns @ constants(lost)
    printed, right = load + force, load - force
    found = {}
    for name, direction in (("as Eq. (5)", 1.0), ("as printed", -1.0)):
        values = _SIZES * np.linalg.lstsq(direction * columns * _SIZES, load, rcond=1e-10)[0]
        found[name] = (float(values[:3].sum() - values[3:6].sum()), float(values[6]))
    return Finding(
        "sign", "Eq. (11) has the signs of Eq. (5) reversed",
        ("Eq. (5) holds the weight with the film: m g = Σ α F. Within the brackets of Eq. (11) both terms have the "
         "other sign, so that its residual at the model's own rests, where it should vanish, is "
         f"{np.abs(printed / load).max():.4f} times the weight (with the signs of Eq. (5): "
         f"{np.abs(right / load).max():.1e}).",
         "Minimised as printed over data without an error it finds a film that pushes: a stress of "
         f"{found['as printed'][0] / 1e3:.1f} kPa at the mounted stretch and ε_r {found['as printed'][1]:.2f}, the "
         "exact opposite of the truth. Table 1's constants have the right sign, so their search can hardly have "
         "minimised what is printed. c₂ of Eq. (11) is not defined there; Eq. (5) makes it ε₀ε_r/z₀²."),
        (Number("residual over weight, as printed", float(np.abs(printed / load).max())),
         Number("residual over weight, signs of Eq. (5)", float(np.abs(right / load).max())),
         *(Number(f"stress at the mounted stretch found, {name}", value[0], "Pa")
           for name, value in found.items()),
         *(Number(f"relative permittivity found, {name}", value[1])
           for name, value in found.items())))
