"""FElupe: the voltage at which a weighted membrane first loses its tension, by a ramp.

At each voltage the travel of the plate is found at which the membrane carries the weight. The
voltage is raised in increments. After the first one that takes the tension away at some quadrature
point, the increment is halved from the last taut state, until it is as small as the wanted
accuracy. Prints one JSON object for each mesh.
"""

from __future__ import annotations

import argparse
import json
import time

import numpy as np
import symmetric_lu
from annulus import Annulus, quads
from felupe_membrane import Array, PrestretchedMembrane, fem
from harness import LIMIT, PROBLEM
from scipy.optimize import root_scalar

#: Difference of two travels [mm] at the same voltage, over which the force's secant is taken first.
_NUDGE = 1e-3
#: Largest eigenvalue along the normal [N/mm], which is 0 but for rounding.
_ROUNDING = 1e-12


class ChargedMembrane(PrestretchedMembrane):
    """A membrane under a voltage: less e/2 det C per mounted area, with e = ε U²/h [N/mm]."""

    charge = 0.0

    def gradient(self, x: list[Array]) -> list[Array]:
        """First Piola-Kirchhoff stress, less e det C F C^-1."""
        stress, statevars = super().gradient(x)
        inverse, det = self._metric(x[0])
        return [stress - self.charge * det * np.einsum("iJ...,JK...->iK...", x[0], inverse),
                statevars]

    def hessian(self, x: list[Array]) -> list[Array]:
        """Derivative of the stress by F; G = F C^-1, projector on the normal I - G F^T."""
        f, (moduli,) = x[0], super().hessian(x)
        inverse, det = self._metric(f)
        dual = np.einsum("iJ...,JK...->iK...", f, inverse)
        normal = np.eye(3)[:, :, None, None] - np.einsum("iJ...,kJ...->ik...", dual, f)
        change = 2 * np.einsum("iJ...,kL...->iJkL...", dual, dual)
        change -= np.einsum("iL...,kJ...->iJkL...", dual, dual)
        change += np.einsum("ik...,JL...->iJkL...", normal, inverse)
        return [moduli - self.charge * det * change]

    def least_tension(self, f: Array) -> float:
        """Smaller principal value of P F^T, of the sign of the smaller principal stress."""
        stress, _ = self.gradient([f, np.zeros(0)])
        tension = np.einsum("iJ...,kJ...->...ik", stress, f)
        # One of the three eigenvalues is 0, along the normal.
        least, middle, _ = np.moveaxis(np.linalg.eigvalsh(tension), -1, 0)
        return float(np.where(least < -_ROUNDING, least, middle).min())


class Actuator:
    """The membrane with its plate; keeps the last state as the start of the next solution."""

    def __init__(self, annulus: Annulus) -> None:
        self.annulus = annulus
        mesh = fem.Mesh(annulus.points, annulus.cells, "quad9")
        self.field = fem.FieldContainer([fem.Field(fem.RegionBiQuadraticQuad(mesh), dim=3)])
        self.film = ChargedMembrane(PROBLEM.mu, PROBLEM.mounted_thickness, PROBLEM.prestretch)
        self.membrane = fem.SolidBody(self.film, self.field)
        self.values = np.zeros((mesh.npoints, 3))
        fixed = np.zeros((mesh.npoints, 3), dtype=bool)
        fixed[np.concatenate([annulus.inner, annulus.outer])] = True
        self.fixed, self.free = np.flatnonzero(fixed), np.flatnonzero(~fixed)
        self.travel = PROBLEM.travel

    def force(self, travel: float) -> float:
        """Force on the plate [N] at a travel [mm]."""
        self.values[self.annulus.inner, 2] = travel
        result = fem.newtonraphson(
            items=[self.membrane], x0=self.field, dof0=self.fixed, dof1=self.free,
            ext0=self.values.ravel()[self.fixed], solver=symmetric_lu.spsolve, verbose=0)
        return float(result.fun.reshape(-1, 3)[self.annulus.inner, 2].sum())

    def taut(self, voltage: float) -> bool:
        """Whether there is an equilibrium without compression at a voltage [V]."""
        try:
            return self.tension(voltage) > 0
        except fem.tools.NewtonConvergenceError:
            return False

    def tension(self, voltage: float) -> float:
        """Least tension where the membrane carries the weight at a voltage [V]."""
        self.film.charge = LIMIT.permittivity * voltage**2 / PROBLEM.mounted_thickness
        self.travel = root_scalar(lambda travel: self.force(travel) - LIMIT.weight,
                                  x0=self.travel, x1=self.travel + _NUDGE,
                                  xtol=LIMIT.accuracy * self.travel).root
        return self.film.least_tension(self.field.extract()[0])


def first_loss(actuator: Actuator) -> float:
    """Raise the voltage [V] until the tension is lost; halve the increment back to there."""
    reached, increment = 0.0, LIMIT.increment
    actuator.tension(0.0)
    while increment > LIMIT.accuracy * max(reached, LIMIT.increment):
        kept, travel = actuator.field[0].values.copy(), actuator.travel
        if actuator.taut(reached + increment):
            reached += increment
        else:
            actuator.field[0].values[:], actuator.travel = kept, travel
            increment /= 2
    return reached


def main() -> None:
    """Print a JSON object for each of some meshes, each twice as fine."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--levels", type=int, default=2)
    options = parser.parse_args()
    first_loss(Actuator(quads(PROBLEM.inner, PROBLEM.outer, 2, 8, order=2)))
    for level in range(options.levels):
        n_r = 4 * 2**level
        began = time.perf_counter()
        actuator = Actuator(quads(PROBLEM.inner, PROBLEM.outer, n_r, 4 * n_r, order=2))
        voltage = first_loss(actuator)
        print(json.dumps({"package": "FElupe", "version": fem.__version__,
                          "unknowns": len(actuator.free), "voltage_V": voltage,
                          "seconds": time.perf_counter() - began}), flush=True)


if __name__ == "__main__":
    main()
