"""The factorised tangent: the film's sparse part, and the plate's freedoms with the unknown load as a border."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem.direct import factorise
from fem.model import Linearised, Model
from fem.plate import HEAVE
from fem.state import State, Unknown

Array = NDArray[np.float64]

#: A right-hand side or a correction: free nodal components, and plate freedoms in the model's order.
Parts = tuple[Array, Array]


class Tangent:
    """Block elimination with the film factorised once.

    The border's columns are the plate's freedoms, the heave replaced by the force or U² when one of them is unknown;
    so the film's matrix and its pattern are the same whatever is solved for.
    """

    def __init__(self, model: Model, part: Linearised, unknown: Unknown, state: State, spring: float) -> None:
        self.model, self.unknown = model, unknown
        self._lu = factorise(part.inner, model.analysis)
        self._border, corner = part.border, part.corner.copy()
        self._row = model.plate_freedoms.index(HEAVE)
        corner[self._row, self._row] += spring / model.mirrored
        self._influence = np.asarray(self._lu.solve(part.border))
        self._schur = corner - part.border.T @ self._influence
        self._bordered, self._columns = self._schur, self._influence
        if unknown != "heave":
            inner, plate = self.parameter(state, unknown)
            response = self._lu.solve(inner)
            self._columns = self._influence.copy()
            self._columns[:, self._row] = response
            self._bordered = self._schur.copy()
            self._bordered[:, self._row] = plate - part.border.T @ response

    @property
    def plate_stable(self) -> bool:
        """Whether the stiffness of the plate's freedoms, the film condensed out, is positive definite."""
        return bool(np.linalg.eigvalsh((self._schur + self._schur.T) / 2)[0] > 0)

    @property
    def heave_stiffness(self) -> float:
        """dF/dw of the whole plate [N/m] at constant voltage, everything else following."""
        return float(self.model.mirrored / np.linalg.inv(self._schur)[self._row, self._row])

    @property
    def wrinkling(self) -> int:
        """Number of negative eigenvalues of the film with the plate held, by Sylvester's law from the pivots."""
        return self._lu.negative

    def parameter(self, state: State, name: Unknown) -> Parts:
        """Derivative of the residual by the force or by U²."""
        if name == "force":
            plate = np.zeros(len(self.model.plate_freedoms))
            plate[self._row] = -1 / self.model.mirrored
            return np.zeros(self._border.shape[0]), plate
        forces = self.model.voltage_forces(state.positions)
        return forces[self.model.free], self.model.plate_forces(forces, state.plate)

    def solve(self, right: Parts, unknown: Unknown | None = None) -> Parts:
        """The correction for a right-hand side; ``unknown="heave"`` solves for the heave whatever this was made for."""
        bordered, columns = (self._schur, self._influence) if unknown == "heave" else (self._bordered, self._columns)
        particular = self._lu.solve(right[0])
        border = np.linalg.solve(bordered, right[1] - self._border.T @ particular)
        return particular - columns @ border, border

    def raised(self, change: float) -> Parts:
        """Right-hand side that makes up for a change of the heave [m] by the unknown and everything else."""
        corner = self._schur[:, self._row] + self._border.T @ self._influence[:, self._row]
        return -change * self._border[:, self._row], -change * corner
