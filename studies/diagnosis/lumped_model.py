"""Force laws of the paper's lumped model, for the same diagnosis as that of finite elements.

``Simulation(setup, lumped_laws(setup, grids))`` with a setup of :func:`lumped` specimens is all a
diagnosis needs. The rig acts as it does on finite elements; of the effects that change films only
those act that the lumped model knows of.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.circles import Lumped
from tympan.studies.diagnosis.reduced.axes import HeldFilm, film_axes, sampled_film
from tympan.studies.diagnosis.reduced.force_law import ForceLaw, Grid, law_through, samples
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
    return tuple(_law(setup, specimen.name, grid)
                 for specimen, grid in zip(setup.specimens, grids, strict=True))


def _law(setup: Setup, name: str, grid: Grid) -> ForceLaw:
    film = HeldFilm.of(setup, name)
    if not (film.odd and grid.odd):
        raise InputError("must be without gas pressure, weight of its own and offset weights in "
                         "the lumped model", key="specimen", given=name)
    nominal = lumped_nodes(film.specimen, grid)
    axes = tuple(axis for axis in film_axes(setup, name) if not np.array_equal(
        lumped_nodes(sampled_film(setup, name, (axis,), ((0, 1.0),)).specimen, grid), nominal))
    return law_through(grid, axes, {
        sample: lumped_nodes(sampled_film(setup, name, axes, sample).specimen, grid.at(sample))
        for sample in samples(axes)})


def lumped_nodes(specimen: Specimen, grid: Grid) -> tuple[Array, Array]:
    """Force [N] and capacitance [F] at the nodes of a grid, shape (heaves, voltages) each."""
    if not isinstance(specimen, Lumped):
        raise InputError("must be a specimen of the lumped model", key="specimen",
                         given=specimen.name)
    heaves, voltages_squared = grid.nodes
    force = [[specimen.force(heave, voltage_squared**0.5) for voltage_squared in voltages_squared]
             for heave in heaves]
    capacitance = [[specimen.capacitance(heave)] * len(voltages_squared) for heave in heaves]
    return np.array(force), np.array(capacitance)
