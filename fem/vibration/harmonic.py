"""A film and its plate about an equilibrium, under a voltage that swings a little about its mean.

At rest C_v = C, and since det C and det C_v stay 1 the branches' equation is there, for motions as
e^(s t), (s τ + 1) δC_v = δC. What a branch pulls with depends on δC − δC_v alone, so it adds
s τ/(1 + s τ) times its stiffness at once. The film charges through its circuit,
δU_s = (1 + R/R_l) δU + s R δQ, and δQ has a part of the film's motion.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import newton
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from tympan.base.arrays import AnyArray
from tympan.base.progress import Progress
from tympan.base.system import silent
from tympan.fem.circuit import Circuit
from tympan.fem.film.memory import Memory
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import State
from tympan.fem.transient.film_memory import virgin_strain
from tympan.fem.vibration.modes import System

#: How close to the one before the last complex frequency comes, relative.
_CLOSE = 1e-10
#: Most iterations of that search. The method of secants takes a few from a good guess.
_MOST = 60

#: By how much the second guess of a complex frequency differs from the first.
_ASIDE = 1e-3


@dataclass(frozen=True, eq=False)
class Harmonic:
    """A film at rest in a ``state``, its ``plate``, a ``damper`` on its heave [N s/m], a circuit.

    The whole film's plate and damper; motions are even about the planes the model is mirrored at.
    Without a plate the film's centre heaves.
    """

    model: Model
    state: State
    plate: RigidPlate
    damper: float = 0.0
    circuit: Circuit = field(default_factory=Circuit)

    def response(self, frequencies: AnyArray,
                 progress: Progress = lambda words: None) -> tuple[AnyArray, AnyArray]:
        """Heave [m/V] and film voltage [V/V] over the source's, complex, of frequencies [Hz]."""
        numbers = np.empty((2, len(frequencies)), complex)
        for number, frequency in enumerate(frequencies.tolist()):
            progress(f"{frequency:.4g} Hz")
            numbers[:, number] = self._driven(2j * np.pi * frequency)
        return numbers[0], numbers[1]

    def natural(self, guess: complex) -> complex:
        """The s [1/s] near a guess at which the heave swings by itself, as e^(s t).

        A zero of the force that it takes to swing the plate.

        Raises
        ------
        RuntimeError
            When none is found.
        """
        root = newton(self._dynamic_stiffness, guess, x1=guess * (1 + _ASIDE), tol=_CLOSE,
                      rtol=_CLOSE, maxiter=_MOST)
        return complex(root)

    @property
    def _voltage(self) -> float:
        return float(np.sqrt(self.state.voltage_squared))

    def _driven(self, s: complex) -> tuple[complex, complex]:
        motion = self._solved(s, self._electric)
        shared = 4 * self.state.voltage_squared * self.model.discretisation.mirrored
        charge = self._capacitance + shared * (self._electric @ motion)
        circuit = self.circuit
        voltage = 1 / (1 + circuit.resistance * (1 / circuit.leakage + s * charge))
        return complex(-2 * self._voltage * (self._lift @ motion) * voltage), complex(voltage)

    def _dynamic_stiffness(self, s: complex) -> complex:
        """Force on plate or centre over its heave at constant voltage [N/m]."""
        moved = self._lift @ self._solved(s, self._lift)
        return complex(self.model.discretisation.mirrored / moved)

    def _solved(self, s: complex, right: AnyArray) -> AnyArray:
        stiffness, viscous, mass = self._matrices
        share = sum((branch.modulus * (s * branch.time) / (1 + s * branch.time)
                     for branch in self.model.specimen.membrane.branches), 0j)
        dynamic = (stiffness + share * viscous + s * s * mass).tocsc()
        if self.damper:
            heave = int(self._lift.argmax())
            dynamic[heave, heave] += s * self.damper / self.model.discretisation.mirrored
        with silent():
            factors = splu(dynamic)
        return np.asarray(factors.solve(right.astype(complex)))

    @cached_property
    def _lift(self) -> AnyArray:
        """Derivative of the heave by the unknowns."""
        return np.concatenate(self.model.lift)

    @cached_property
    def _electric(self) -> AnyArray:
        """Derivative of the forces by U² [N/V²]."""
        return np.concatenate(self.model.by_load(self.state, "voltage"))

    @cached_property
    def _capacitance(self) -> float:
        return float(self.model.capacitance(self.state))

    @cached_property
    def _matrices(self) -> tuple[csc_matrix, csc_matrix, csc_matrix]:
        """Stiffness at rest, that of branches at once over their moduli, mass."""
        rest = System.of(self.model, self.state, self.plate)
        film = self.model.specimen.membrane
        if not film.branches:
            return rest.stiffness, 0 * rest.stiffness, rest.mass
        strain = virgin_strain(self.model, self.state)
        flow = Memory.relaxed(film, strain).step(strain, 0.0)
        at_once = System.of(replace(self.model, flow=flow), self.state, self.plate)
        total = sum(branch.modulus for branch in film.branches)
        return rest.stiffness, (at_once.stiffness - rest.stiffness) / total, rest.mass
