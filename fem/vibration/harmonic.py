"""Small harmonic motion of film and plate about an equilibrium, driven by the voltage.

At rest C_v = C, and det C and det C_v stay 1. For motions as e^(s t), the branches' equation is
therefore (s τ + 1) δC_v = δC. The stress of a branch depends on δC − δC_v alone, so the branch adds
s τ/(1 + s τ) times its instantaneous stiffness. The film charges through its circuit: δU_s = (1 +
R/R_l) δU + s R δQ, and δQ includes a part from the film's motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import newton
from scipy.sparse import csc_matrix

from tympan.base.arrays import AnyArray
from tympan.base.progress import Progress
from tympan.fem.circuit import Circuit
from tympan.fem.complex_step import STEP
from tympan.fem.film.memory import Memory
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import State
from tympan.fem.transient.film_memory import virgin_strain
from tympan.fem.vibration.frequency_sweep import FrequencySweep
from tympan.fem.vibration.modes import System

#: Relative tolerance of the last complex frequency.
_CLOSE = 1e-10
#: Largest number of iterations of that search. The secant method needs a few from a good guess.
_MOST = 60

#: Change of the last complex frequency, relative to it, by one more solution of the film. The error
#: that is left is its square.
_NATURAL = 1e-6

#: Relative difference of the second guess of a complex frequency from the first.
_ASIDE = 1e-3


@dataclass(frozen=True)
class HarmonicMotion:
    """Complex amplitudes over the source's voltage, at each of n frequencies.

    ``deflection`` [m/V], (n,); ``slopes`` of the plate along x and y [rad/V], (n, 2); ``voltage``
    of the film [V/V], (n,).
    """

    deflection: AnyArray
    slopes: AnyArray
    voltage: AnyArray


@dataclass(frozen=True, eq=False)
class Harmonic:
    """A film at rest in a ``state``, with plate, ``damper`` on the deflection [N s/m] and circuit.

    Plate and damper are those of the whole film. Motions are even about the model's mirror planes.
    Without a plate the deflection is that of the film's centre. ``swing``: amplitude of each
    segment's voltage over that of the source, (segments,); by default the segments' shares.
    """

    model: Model
    state: State
    plate: RigidPlate
    damper: float = 0.0
    circuit: Circuit = field(default_factory=Circuit)
    swing: tuple[float, ...] | None = None

    def response(self, frequencies: AnyArray,
                 progress: Progress = lambda words: None) -> HarmonicMotion:
        """Compute the motion under a small sine of the source's voltage, at frequencies [Hz].

        ``progress`` is called with each frequency at which the film is solved; the others follow
        from these.
        """
        points = 2j * np.pi * frequencies
        outputs = self._sweep.outputs(
            points, lambda number: progress(f"{frequencies[number]:.4g} Hz"))
        shared = 4 * self.state.voltage_squared * self.model.discretisation.mirrored
        charge = self._capacitance + shared * outputs[:, 1, 1]
        circuit = self.circuit
        voltage = 1 / (1 + circuit.resistance * (1 / circuit.leakage + points * charge))
        moved = -2 * self._voltage * outputs[:, :, 1] * voltage[:, None]
        slopes = np.zeros((len(frequencies), 2), complex)
        slopes[:, list(self._sloping)] = moved[:, 2:]
        return HarmonicMotion(moved[:, 0], slopes, voltage)

    def natural(self, guess: complex) -> complex:
        """Find the s [1/s] near a guess at which the deflection oscillates freely as e^(s t).

        It is a zero of the dynamic stiffness of the plate.

        Raises
        ------
        RuntimeError
            If no zero is found.
        """
        found = guess
        self._sweep.solve(guess * (1 + _ASIDE))
        for _ in range(_MOST):
            before = found
            self._sweep.solve(before)
            found = complex(newton(self._dynamic_stiffness, before, x1=before * (1 + _ASIDE),
                                   tol=_CLOSE, rtol=_CLOSE, maxiter=_MOST))
            if abs(found - before) <= _NATURAL * abs(found):
                return found
        raise RuntimeError("no natural frequency was found")

    @property
    def _voltage(self) -> float:
        return float(np.sqrt(self.state.voltage_squared))

    def _dynamic_stiffness(self, s: complex) -> complex:
        """Compute force over deflection of plate or centre, at constant voltage [N/m].

        The film moves as it does at the s where it was solved.
        """
        return complex(self.model.discretisation.mirrored / self._sweep.output(s)[0, 0])

    @cached_property
    def _sweep(self) -> FrequencySweep:
        """Motions due to a unit force on the deflection, due to U², and due to unit moments."""
        stiffness, viscous, mass = self._matrices
        damper = csc_matrix(stiffness.shape)
        if self.damper:
            heave = int(self._lift.argmax())
            weight = self.damper / self.model.discretisation.mirrored
            damper = csc_matrix(([weight], ([heave], [heave])), shape=stiffness.shape)
        branches = self.model.specimen.membrane.branches

        def factors(s: complex) -> tuple[complex, ...]:
            share = sum((branch.modulus * (s * branch.time) / (1 + s * branch.time)
                         for branch in branches), 0j)
            return 1.0 + 0j, share, s * s, s

        right = np.column_stack([self._lift, self._electric, *self._sloping.values()])
        return FrequencySweep((stiffness, viscous, mass, damper), factors, right)

    @cached_property
    def _lift(self) -> AnyArray:
        """Derivative of the deflection with respect to the unknowns."""
        return np.concatenate(self.model.lift)

    @cached_property
    def _sloping(self) -> dict[int, AnyArray]:
        """Derivatives of the plate's slopes that are not 0 by symmetry, by the axis along which."""
        whole = {axis: np.concatenate(self.model.sloped(self.state, axis)) for axis in range(2)}
        return {axis: slope for axis, slope in whole.items() if slope.any()}

    @cached_property
    def _electric(self) -> AnyArray:
        """Derivative of the forces by half of the source's voltage squared [N/V²].

        Forces go with the square of each segment's voltage: what a segment adds goes with its share
        times its swing. A complex step of the shares along the swing gives the sum.
        """
        if self.swing is None:
            return np.concatenate(self.model.by_load(self.state, "voltage"))
        shares = [segment.share for segment in self.model.specimen.electrode.segments]
        stepped = [share + 1j * STEP * swing
                   for share, swing in zip(shares, self.swing, strict=True)]
        forces = self._with_shares(stepped).forces(self.state.positions,
                                                   self.state.voltage_squared)
        by_shares = np.imag(forces) / (2 * STEP * self.state.voltage_squared)
        return np.concatenate(self.model.on_freedoms(by_shares, self.state.plate))

    @cached_property
    def _capacitance(self) -> float:
        """Charge over voltage of the source, at a film that does not move [F]."""
        model = self.model if self.swing is None else self._with_shares(self.swing)
        return float(model.capacitance(self.state))

    def _with_shares(self, shares: Sequence[Any]) -> Model:
        specimen = self.model.specimen
        electrode = specimen.electrode.with_shares(shares)
        return replace(self.model, specimen=replace(specimen, electrode=electrode))

    @cached_property
    def _matrices(self) -> tuple[csc_matrix, csc_matrix, csc_matrix]:
        """Stiffness at rest, instantaneous stiffness of branches over their moduli, and mass."""
        rest = System.of(self.model, self.state, self.plate)
        film = self.model.specimen.membrane
        if not film.branches:
            return rest.stiffness, csc_matrix(rest.stiffness.shape), rest.mass
        strain = virgin_strain(self.model, self.state)
        flow = Memory.relaxed(film, strain).step(strain, 0.0)
        at_once = System.of(replace(self.model, flow=flow), self.state, self.plate)
        total = sum(branch.modulus for branch in film.branches)
        return rest.stiffness, (at_once.stiffness - rest.stiffness) / total, rest.mass
