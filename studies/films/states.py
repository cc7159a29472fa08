"""Results of many films: their states under loads, and the voltages at which they end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Protocol, Self

import numpy as np

from tympan.base.arrays import AnyArray, Mask


class MeasuresFilms(Protocol):
    """Interface of a family of films: it measures local values of their states, at all nodes."""

    def extremes_of(self, parameters: Any, states: FilmStates, local: Callable[[Any], AnyArray],
                    sign: int) -> AnyArray:
        """Find the extremes of a local field; ``sign``: 1 for the largest, -1 for the least."""

    def means_of(self, parameters: Any, states: FilmStates, local: Callable[[Any], AnyArray],
                 covered: bool) -> AnyArray:
        """Average a local field over the films, or over their parts under the electrode."""


@dataclass(frozen=True, eq=False)
class FilmStates:
    """States of many films under loads: named values of shape (films, states), in SI.

    They are :class:`~tympan.studies.variables.States`. Numbers are nan where the family does not
    hold a state (``holds``). Such states need finite elements.
    """

    #: Voltage across the film [V].
    voltage: AnyArray
    #: Deflection [m].
    deflection: AnyArray
    #: Error of the deflection [m], exceeded in some 1 of 40 films; nan if not estimated.
    error: AnyArray
    #: Force that the film carries [N].
    force: AnyArray
    #: Capacitance of the film [F].
    capacitance: AnyArray
    #: Energy that the film stores [J].
    energy: AnyArray
    #: Stiffness of film, springs and mechanisms against the plate [N/m].
    stiffness: AnyArray
    #: Largest principal stretch from the virgin film.
    stretch: AnyArray
    #: Largest principal true stress [Pa].
    stress: AnyArray
    #: Largest difference of that stress from the stress on a separate mesh of the film [Pa].
    stress_error: AnyArray
    #: Least principal true stress [Pa].
    tension: AnyArray
    #: Largest electric field [V/m].
    electric: AnyArray
    #: Largest share of the electric strength that the field reaches.
    breakdown: AnyArray
    #: Weakest place, where the share is largest, in the mounted film [m], (films, states, 2).
    weakest: AnyArray
    #: Place of the least true stress, in the mounted film [m], (films, states, 2).
    loosest: AnyArray
    #: Electric field at the weakest place [V/m].
    weakest_field: AnyArray
    #: Electric strength at the weakest place [V/m].
    weakest_strength: AnyArray
    #: Slopes of the plate along x and y [rad], (films, states, 2).
    slope: AnyArray
    #: Error of these slopes [rad]; nan if not estimated.
    slope_error: AnyArray
    #: Motion of the plate's centre along x and y [m], (films, states, 2).
    shift: AnyArray
    #: Lowest frequency along the load [Hz]; nan if no mass was given.
    frequency: AnyArray
    #: Amplitudes of the shapes, (films, states, shapes).
    q: AnyArray
    #: Mask of states in which the film is stable in its plane and within its law's range.
    sound: Mask
    #: Mask of states that are stable and in tension, with film and loads in the family's ranges.
    holds: Mask
    #: Mask of stable states that are not in tension everywhere.
    slack: Mask
    #: Family that measures further local values, and the films' parameters or the films.
    family: MeasuresFilms | None = field(default=None, repr=False)
    parameters: Any = field(default=None, repr=False)

    @classmethod
    def joined(cls, several: Sequence[Self], family: MeasuresFilms, parameters: Any) -> Self:
        """Join the states of several groups of films, one group after the other."""
        arrays = {item.name: np.concatenate([getattr(each, item.name) for each in several])
                  for item in fields(cls) if item.name not in ("family", "parameters")}
        return cls(**arrays, family=family, parameters=parameters)

    @property
    def tilt(self) -> AnyArray:
        """Tilt of the plate [rad]."""
        sines = np.sin(self.slope)
        return np.asarray(np.arcsin(np.minimum(np.hypot(sines[..., 0], sines[..., 1]), 1.0)))

    @property
    def slack_area(self) -> AnyArray:
        """Mounted area that has lost tension [m²]: 0, and nan of slack films."""
        return np.where(self.slack, np.nan, 0.0)

    @property
    def slack_share(self) -> AnyArray:
        """Share of that in the mounted area."""
        return self.slack_area

    def largest(self, local: Callable[[Any], AnyArray]) -> AnyArray:
        """Find the largest value of a local field at the nodes of every element."""
        assert self.family is not None
        return self.family.extremes_of(self.parameters, self, local, 1)

    def least(self, local: Callable[[Any], AnyArray]) -> AnyArray:
        """Find the least value of a local field at the nodes of every element."""
        assert self.family is not None
        return self.family.extremes_of(self.parameters, self, local, -1)

    def mean(self, local: Callable[[Any], AnyArray], *, covered: bool = False) -> AnyArray:
        """Average a local field over the mounted films, or their parts under the electrode."""
        assert self.family is not None
        return self.family.means_of(self.parameters, self, local, covered)


@dataclass(frozen=True, eq=False)
class FilmEnds:
    """Voltages [V] at which films break down, lose tension or pull in, (films, forces) each.

    A voltage is infinite if the event does not happen within the family's voltages, or if a pull-in
    comes first. It is nan if there is no state at the lowest of these voltages, and beyond the loss
    of tension.
    """

    breakdown: AnyArray
    tension: AnyArray
    pull_in: AnyArray

    @property
    def taut(self) -> AnyArray:
        """Voltage up to which films are taut and stable [V]."""
        return np.fmin(self.tension, self.pull_in)
