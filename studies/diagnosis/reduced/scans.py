"""Scans of films: shapes of the reduced model at places of table or plate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.results.places import Places
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.diagnosis.reading_table import Scan
from tympan.studies.diagnosis.reduced.axes import Axis, Sample, sampled_film
from tympan.studies.diagnosis.reduced.film_shape import (
    ALONG,
    AROUND,
    FilmShape,
    Lattice,
    lattice_of,
)
from tympan.studies.diagnosis.reduced.force_law import ForceSurface
from tympan.studies.diagnosis.reduced.swinging import Sag
from tympan.studies.effects import Setup

#: Most halvings of sizes with which together no specimen can be built.
_TRIES = 20


@dataclass(frozen=True, eq=False)
class FlatLattices:
    """The flat lattices of a specimen of that name, for any sizes of its law's axes."""

    setup: Setup
    name: str
    axes: tuple[Axis, ...]

    def lattice(self, sizes: Array) -> Lattice:
        """Make the lattice at sizes of the axes on the nominal film, shape (axes,)."""
        return _lattice(self, tuple((number, float(sizes[number])) for number in self._moving
                                    if sizes[number]))

    @cached_property
    def _moving(self) -> tuple[int, ...]:
        """Axes along which frame or plate are displaced."""
        nominal = self.setup.specimen(self.name)
        films = [self.film(((number, axis.places[-1]),)) for number, axis in enumerate(self.axes)]
        return tuple(number for number, film in enumerate(films)
                     if (film.frame, film.plate) != (nominal.frame, nominal.plate))

    def film(self, sample: Sample) -> Specimen:
        return sampled_film(self.setup, self.name, self.axes, sample).specimen


@lru_cache(maxsize=1024)
def _lattice(lattices: FlatLattices, sample: Sample) -> Lattice:
    for _ in range(_TRIES):
        try:
            film = lattices.film(sample)
            return lattice_of(film.frame, film.plate)
        except InputError:
            sample = tuple((number, size / 2) for number, size in sample)
    return _lattice(lattices, ())


@lru_cache(maxsize=1024)
def scanned(surface: ForceSurface, lattice: Lattice, sag: Sag | None, scan: Scan, deflection: float,
            voltage_squared: float | tuple[float, ...], pressure: float) -> Array:
    """Compute displacements at a scan's places [m], shape (3, n), deflections last.

    They are nan without equilibrium.
    """
    if not np.isfinite(deflection):
        return np.full((3, len(scan)), np.nan)
    values = surface.shape(deflection, voltage_squared).reshape(3, ALONG, AROUND)
    if sag is not None and pressure:
        values = np.stack([*values[:2], values[2] + pressure * sag.by_pressure])
    shape = FilmShape.of(lattice, values)
    place = scan.place + lattice.centre if scan.centred else scan.place
    if scan.follows:
        return shape.displacements(place)
    heights = shape.heights(place)
    return np.stack([np.zeros_like(heights), np.zeros_like(heights), heights])


def scanned_exactly(specimen: Specimen, rig: Rig, mass: float, voltage: float, scan: Scan,
                    settings: Settings) -> Array | None:
    """Compute a scan by finite elements of a specimen at rest under a mass [kg], a voltage [V].

    The lattice serves only to find material points. None where there is no equilibrium.
    """
    model = build_model(specimen, settings, rig.loading)
    force = rig.force(mass, model.plate_area)
    outcome = equilibrium(model, force, rig.film_voltage(voltage), rig.gas_pressure)
    if outcome.status != "equilibrium":
        return None
    lattice = lattice_of(specimen.frame, specimen.plate)
    moved = Places.of(model.discretisation, lattice.flat).displacement(model, outcome.state)
    shape = FilmShape.of(lattice, moved.T.reshape(3, ALONG, AROUND))
    place = scan.place + lattice.centre if scan.centred else scan.place
    shown = shape.displacements(place) if scan.follows else np.stack(
        [np.zeros(len(scan)), np.zeros(len(scan)), shape.heights(place)])
    origin, film = (place, (specimen.needed_plate().level(*place.T) > 0) & (
        specimen.frame.level(*place.T) < 0)) if scan.follows else shape.origins(place)
    shown[:, film] = Places.of(model.discretisation, origin[film]).displacement(
        model, outcome.state).T
    return shown
