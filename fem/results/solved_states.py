"""Equilibrium states of a finite-element film, with what they show in arrays (states,)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray, Array
from tympan.fem.discretisation.isoparametric import quadrature
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import (
    Fields,
    LostTension,
    cell_fields,
    largest,
    least,
    lost_tension,
    node_fields,
)

#: Coordinates [m] below this are rounding errors of 0.
_NOTHING = 1e-15

#: Least tension over the largest stress above which a film is the same if it cannot wrinkle: its
#: residual tension is far smaller.
_TAUT = 0.1


@dataclass(frozen=True, eq=False)
class SolvedStates:
    """States of one model, as :class:`~tympan.studies.variables.States`; computed together.

    ``strength``: factor on the film's electric strength. Each quantity is computed at first use.
    """

    model: Model
    states: Sequence[State]
    strength: float = 1.0

    @cached_property
    def at_nodes(self) -> list[Fields]:
        """Fields of each state at the nodes of every element."""
        return node_fields(self.model, self.states)

    @cached_property
    def pressed(self) -> list[Fields]:
        """Fields of each state at the same nodes if the film could not wrinkle."""
        if not self.model.wrinkles:
            return self.at_nodes
        some = [number for number, fields in enumerate(self.at_nodes) if self.model.flow is not None
                or not (fields.stress_2 > _TAUT * fields.stress_1.max(initial=0.0)).all()]
        if not some:
            return self.at_nodes
        unwrinkled = node_fields(replace(self.model, wrinkles=False),
                                 [self.states[number] for number in some])
        found = dict(zip(some, unwrinkled, strict=True))
        return [found.get(number, fields) for number, fields in enumerate(self.at_nodes)]

    @cached_property
    def lost(self) -> list[LostTension]:
        """Parts of the film that have lost tension in each state."""
        return lost_tension(self.model, self.states, at_nodes=self.at_nodes)

    @cached_property
    def _integrals(self) -> tuple[AnyArray, AnyArray, AnyArray]:
        return self.model.integrals(self.states)

    @property
    def deflection(self) -> AnyArray:
        """Deflection of the plate, or of the centre without one [m]."""
        return np.array([self.model.deflection(state) for state in self.states])

    @property
    def force(self) -> AnyArray:
        """Force that the film carries [N]."""
        return self._integrals[0]

    @property
    def capacitance(self) -> AnyArray:
        """Capacitance of the film [F]."""
        return self._integrals[1]

    @property
    def energy(self) -> AnyArray:
        """Energy of the film at constant voltage, from the virgin film on [J]."""
        return self._integrals[2]

    @property
    def stretch(self) -> AnyArray:
        """Largest principal stretch from the virgin film."""
        return self.largest(lambda fields: fields.stretch_1)

    @property
    def stress(self) -> AnyArray:
        """Largest principal true stress [Pa]."""
        return self.largest(lambda fields: fields.stress_1)

    @property
    def tension(self) -> AnyArray:
        """Least principal true stress of a film that bears compression [Pa]."""
        return self._each(least, lambda fields: fields.stress_2, self.pressed)

    @property
    def electric(self) -> AnyArray:
        """Largest electric field [V/m]."""
        return self.largest(lambda fields: fields.electric_field)

    @property
    def breakdown(self) -> AnyArray:
        """Largest share of the electric strength that the field reaches."""
        return self.largest(lambda fields: fields.breakdown_share) / self.strength

    @property
    def weakest(self) -> AnyArray:
        """Place of that share in the mounted film [m], (states, 2)."""
        if not self.model.meshed:
            return np.full((len(self.states), 2), np.nan)
        return np.array([mounted_place(fields.position[int(np.argmax(fields.breakdown_share))])
                         for fields in self.at_nodes])

    @property
    def tilt(self) -> AnyArray:
        """Tilt of the plate [rad]."""
        return np.array([state.plate.tilt for state in self.states])

    @property
    def slope(self) -> AnyArray:
        """Slopes of the plate along x and y [rad], (states, 2)."""
        return np.array([state.plate.slope for state in self.states])

    @property
    def shift(self) -> AnyArray:
        """Motion of the plate's centre along x and y [m], (states, 2)."""
        return np.array([state.plate.translation[:2] for state in self.states])

    @property
    def slack_area(self) -> AnyArray:
        """Mounted area with tension in one direction or none [m²]."""
        return self._of_mesh([lost.wrinkled + lost.slack for lost in self.lost])

    @property
    def slack_share(self) -> AnyArray:
        """Share of that in the mounted area."""
        return self._of_mesh([lost.share for lost in self.lost])

    def _of_mesh(self, values: Sequence[float]) -> AnyArray:
        """Return values of a meshed film; nan for a film that has no fields."""
        return np.array(values) if self.model.meshed else np.full(len(values), np.nan)

    def _each(self, extreme: Callable[[AnyArray], float | None], field: Callable[[Any], AnyArray],
              films: Sequence[Fields]) -> AnyArray:
        """Find an extreme of a field in each state; nan for a film that has no fields."""
        return np.array([extreme(field(fields)) for fields in films], dtype=float)

    def largest(self, field: Callable[[Any], AnyArray]) -> AnyArray:
        """Find the largest value of a field at the nodes of every element."""
        return self._each(largest, field, self.at_nodes)

    def least(self, field: Callable[[Any], AnyArray]) -> AnyArray:
        """Find the least value of a field at the nodes of every element."""
        return self._each(least, field, self.at_nodes)

    def mean(self, field: Callable[[Any], AnyArray], *, covered: bool = False) -> AnyArray:
        """Average a field over the mounted film, or over its part under the electrode."""
        if not self.model.meshed:
            return np.full(len(self.states), np.nan)
        mesh = self.model.discretisation
        weights = mesh.weights * (self.model.covered if covered else 1.0)
        share = (weights / weights.sum()).ravel()
        points = cell_fields(self.model, self.states, quadrature(mesh.mesh.order)[0])
        return np.array([field(fields) @ share for fields in points])


def mounted_place(position: Array) -> tuple[float, float]:
    """Read x and y [m] of a place in the mounted film; rounding errors of 0 become 0."""
    x, y = (0.0 if abs(value) < _NOTHING else float(value) for value in position[:2])
    return x, y
