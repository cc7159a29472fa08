"""Eq. (11) as printed asks the film to push down with the weight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.laws import Separable
from tympan.fem.rig import Rig
from tympan.studies.identify.static import StaticProblem
from tympan.studies.paper.published import MASSES
from tympan.studies.paper.table1 import paper_actuators
from tympan.studies.replica.findings.finding import Evidence, Finding
from tympan.studies.replica.missing_parameters import MissingParameters, deflections
from tympan.studies.replica.words import sentences

Array = NDArray[np.float64]
_VOLTAGES = np.linspace(0.0, 7e3, 15)
_SIZES = np.array([*[50e3] * 6, 5.0])


def at_rest(missing: MissingParameters) -> tuple[Array, Array, Array]:
    """Eq. (11) at the model's own rests, which are data without an error.

    Force per unit of β₁…β₃, γ₁…γ₃ and ε_r, shape (readings, 7), these constants, and weights [N].
    """
    specimens = paper_actuators(missing.permittivity)
    rests = deflections(missing.permittivity, missing.alpha, _VOLTAGES[:, None, None])
    voltage, mass, which = (axis.ravel() for axis in np.meshgrid(
        _VOLTAGES, MASSES, np.arange(3), indexing="ij"))
    problem = StaticProblem(specimens, Rig(), which, mass, voltage, rests.ravel())
    law = specimens[0].membrane.material
    assert isinstance(law, Separable)
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
        (Evidence("residual over weight, as printed", float(np.abs(printed / load).max())),
         Evidence("residual over weight, signs of Eq. (5)", float(np.abs(right / load).max())),
         *(Evidence(f"stress at the mounted stretch found, {name}", value[0], "Pa")
           for name, value in searched.items()),
         *(Evidence(f"relative permittivity found, {name}", value[1])
           for name, value in searched.items())))
