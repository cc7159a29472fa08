"""The films of a setup by their force laws, with the effects of hypotheses on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.rig import Rig
from tympan.studies.diagnosis.hypothesis import (
    FACTORS,
    STIFFNESS,
    Cause,
    Hypothesis,
    sizes_of,
    uses_of,
)
from tympan.studies.diagnosis.reduced.axes import Axis
from tympan.studies.diagnosis.reduced.film_memory import FilmMemory
from tympan.studies.diagnosis.reduced.force_law import ForceLaw, ForceSurface
from tympan.studies.diagnosis.reduced.scans import FlatLattices
from tympan.studies.diagnosis.reduced.swinging import SwingingMasses, outer_effects_on_specimens
from tympan.studies.effects import EFFECTS, Setup, extended

#: Logarithm of the largest factor on stiffness or permittivity.
_FACTOR = np.log(20.0)


@dataclass(frozen=True, eq=False)
class ReducedFilms:
    """A setup with the force laws of its films.

    ``masses`` move with the plates where vibrations are read; ``memory`` is that of the runs read.
    """

    setup: Setup
    laws: tuple[ForceLaw, ...]
    masses: SwingingMasses | None = None
    memory: FilmMemory | None = None

    @cached_property
    def flat_lattices(self) -> tuple[FlatLattices, ...]:
        """Lattice of each flat film."""
        return tuple(FlatLattices(self.setup, specimen.name, law.axes) for specimen, law in zip(
            self.setup.specimens, self.laws, strict=True))

    @cached_property
    def capacitance(self) -> Array:
        """Capacitances of the flat nominal films [F], shape (specimens,)."""
        surfaces = [law.at(np.zeros(len(law.axes))) for law in self.laws]
        return np.array([float(surface.capacitance(np.zeros(1), surface.uncharged)[0])
                         for surface in surfaces])

    @cached_property
    def flat_stiffness(self) -> Array:
        """Stiffness of the flat nominal films without voltage [N/m], shape (specimens,)."""
        return np.array([law.at(np.zeros(len(law.axes))).flat_stiffness for law in self.laws])

    @cached_property
    def rig_effects(self) -> frozenset[str]:
        """Effects that edit the rig."""
        return frozenset(name for name, rig in self._rigs.items() if rig != self.setup.rig)

    @cached_property
    def rubbing_effects(self) -> frozenset[str]:
        """Effects with friction of the plates."""
        return frozenset(name for name, rig in self._rigs.items() if rig.friction)

    @cached_property
    def _rigs(self) -> dict[str, Rig]:
        """Rig with each effect at its usual size; effects on one specimen do not change it."""
        bare = Setup((), self.setup.rig)
        return {name: effect.at(bare, [item.deviation for item in effect.parameters]).rig
                for name, effect in EFFECTS.items() if not effect.on_one}

    @cached_property
    def outer_effects(self) -> frozenset[str]:
        """Effects that change no film with its plate held: those of rig, masses and leads."""
        return self.rig_effects | outer_effects_on_specimens(self.setup)

    def outer(self, hypothesis: Hypothesis, unknowns: Array) -> Setup:
        """Apply the effects that change no film with its plate held."""
        uses = zip(hypothesis, uses_of(hypothesis, unknowns), strict=True)
        return extended(self.setup, [use for cause, use in uses
                                     if cause.name in self.outer_effects])

    def surface(self, number: int, hypothesis: Hypothesis, unknowns: Array) -> ForceSurface:
        """Evaluate a specimen's force law with the effects that change it."""
        return self.laws[number].at(self.axis_sizes(number, hypothesis, unknowns))

    def axis_sizes(self, number: int, hypothesis: Hypothesis, unknowns: Array) -> Array:
        """Find the sizes of a law's axes on the nominal film from the unknowns."""
        law = self.laws[number]
        stiffness = float(np.exp(unknowns[STIFFNESS]))
        sizes = np.zeros(len(law.axes))
        for cause in hypothesis:
            values = unknowns[sizes_of(hypothesis, cause)].tolist()
            for place, axis in enumerate(law.axes):
                if (axis.effect, axis.which) == (cause.name, cause.which):
                    sizes[place] = axis.nominal_size(values[axis.index], stiffness)
        return sizes


def affected(films: ReducedFilms, cause: Cause, index: int) -> list[tuple[int, int]]:
    """List the films that a parameter of a cause changes: numbers of law and axis, if any."""
    if not films.laws:
        return []
    return [(number, place) for number, (specimen, law)
            in enumerate(zip(films.setup.specimens, films.laws, strict=True))
            if cause.specimen in (None, specimen.name)
            for place, axis in enumerate(law.axes)
            if (axis.effect, axis.which, axis.index) == (cause.name, cause.which, index)]


def bounds_of(films: ReducedFilms, hypothesis: Hypothesis) -> Array:
    """Find smallest and largest unknowns, (2, p), within the sizes at which films are sampled."""
    return _bounds(films, hypothesis, Axis.span)


def limits_of(films: ReducedFilms, hypothesis: Hypothesis) -> Array:
    """Find smallest and largest unknowns, (2, p), that could be sampled, as far as known."""
    return _bounds(films, hypothesis, Axis.reach)


def _bounds(films: ReducedFilms, hypothesis: Hypothesis,
            largest: Callable[[Axis, int], float]) -> Array:
    low, high = [-_FACTOR] * FACTORS.stop, [_FACTOR] * FACTORS.stop
    for cause in hypothesis:
        for index, parameter in enumerate(cause.effect.parameters):
            axes = [films.laws[law].axes[number]
                    for law, number in affected(films, cause, index)]
            least, most = parameter.limits
            least = max([least, *(-largest(axis, -1) for axis in axes)])
            most = min([most, *(largest(axis, 1) for axis in axes)])
            # The sign of such a parameter changes nothing on any specimen.
            folded = parameter.sign == "even" and all(axis.folded for axis in axes)
            if parameter.switch:
                least = most
            low.append(max(least, 0.0) if folded else least)
            high.append(most)
    return np.array([low, high])
