"""Force laws of the paper's lumped model, for the same diagnosis as that of finite elements.

``Simulation(setup, lumped_laws(setup, grids))`` with a setup of :func:`lumped` specimens is all a
diagnosis needs. The rig acts as it does on finite elements; of the effects that change films only
those act that the lumped model knows of.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.circles import Lumped
from tympan.studies.diagnosis.reduced.axes import Axis, HeldFilm, film_axes, sampled_film
from tympan.studies.diagnosis.reduced.force_law import ForceLaw, Grid
from tympan.studies.diagnosis.reduced.growth import first_laws
from tympan.studies.effects import Setup

Array = NDArray[np.float64]


def lumped(setup: Setup, weights: Mapping[str, tuple[float, ...]] = {}) -> Setup:
    """A setup seen by the lumped model.

    ``weights`` are α of each specimen that is not round (as from
    :func:`tympan.studies.alpha.alpha`), by name, shortest semi-axis first.
    """
    return replace(setup, specimens=tuple(Lumped.of(specimen, weights.get(specimen.name, (1.0,)))
                                          for specimen in setup.specimens))


def lumped_laws(setup: Setup, grids: Sequence[Grid]) -> tuple[ForceLaw, ...]:
    """The force law of every specimen of a lumped setup, with the axes of the effects it shows.

    An :class:`InputError` for what the lumped model has no place for: gas pressure, a film's
    weight, a weight beside the plate's centre.
    """
    for specimen, grid in zip(setup.specimens, grids, strict=True):
        if not (HeldFilm.of(setup, specimen.name).odd and grid.odd):
            raise InputError("must be without gas pressure, weight of its own and offset weights "
                             "in the lumped model", key="specimen", given=specimen.name)
    return first_laws(LumpedFilms(), setup, grids, axes_of=_axes)


def _axes(setup: Setup, name: str) -> tuple[Axis, ...]:
    """Those axes of a film that the lumped model sees."""
    grid = Grid(0.2 * setup.specimen(name).gap, 1e6, odd=True)
    nominal = lumped_nodes(setup.specimen(name), grid)
    return tuple(axis for axis in film_axes(setup, name) if not np.array_equal(lumped_nodes(
        sampled_film(setup, name, (axis,), ((0, axis.places[-1]),)).specimen, grid), nominal))


@dataclass(frozen=True)
class LumpedFilms:
    """The solver of lumped films."""

    def stored(self, film: HeldFilm, grid: Grid) -> Array:
        return lumped_nodes(film.specimen, grid)

    def solved(self, film: HeldFilm, grid: Grid, near: Sequence[HeldFilm]) -> Array:
        return lumped_nodes(film.specimen, grid)


def lumped_nodes(specimen: Specimen, grid: Grid) -> Array:
    """Force [N], capacitance [F] and no tilt at the nodes of a grid, (3, heaves, voltages)."""
    if not isinstance(specimen, Lumped):
        raise InputError("must be a specimen of the lumped model", key="specimen",
                         given=specimen.name)
    heaves, voltages_squared = grid.nodes
    force = [[specimen.force(heave, voltage_squared**0.5) for voltage_squared in voltages_squared]
             for heave in heaves]
    capacitance = [[specimen.capacitance(heave)] * len(voltages_squared) for heave in heaves]
    return np.array([force, capacitance, np.zeros_like(force)])
