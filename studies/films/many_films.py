"""Many films of one reduction under many loads, computed together.

All films of a family move along the same shapes, on one mesh that moves with their outlines. With
reference coordinates ξ of the elements, a film's ∂x/∂ξ is that of its flat mesh plus Σ q_k ∂φ_k/∂ξ.
The second term is the same for all films. The residual and the tangent, which couple the shapes,
are therefore three products of matrices for all films and states together. Everything else is
computed for each film and point. The equations are those of
:class:`tympan.studies.films.film.ReducedFilm` with relaxed branches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import combinations_with_replacement, permutations
from typing import Any, Self

import numpy as np

from tympan.base.arrays import AnyArray, Mask
from tympan.base.paths import with_arrays
from tympan.fem.film.admissibility import acoustic_margin, lawful, strong_ellipticity
from tympan.fem.film.density import FilmDensity
from tympan.fem.membrane.biases import acting
from tympan.fem.membrane.loading import Loading
from tympan.geometry.specimen import Specimen
from tympan.studies.films.box import is_share, plate_areas
from tympan.studies.films.sites import Sites
from tympan.studies.films.tilting import Tilting, each_of

#: Number of states times points that are computed together: some 60 arrays of this size stay in a
#: core's cache. With 8192, films of a tolerance take 7 % more time, those of a sweep the same.
_TOGETHER = 12288

#: Largest number of tangents of a state. Of 15,000 states of four tolerances none took more than
#: six; the others have no equilibrium.
_TANGENTS = 7
#: Root of the allowed error of a state, over the gap: the error is 1e-8 of it.
_LAST = 1e-4
#: Largest number of corrections by the tangent of an earlier state.
_CHORDS = 4
#: Largest ratio of successive corrections for which a tangent is reused.
_SLOW = 0.2

#: Least number of steps over the gap of a plate that mechanisms may make snap: a snap takes
#: several.
_MARCHED = 30
#: Largest number of steps of a plate that may snap; it limits the cost.
_MOST_MARCHED = 400
#: Length of a step relative to an interval of negative stiffness.
_PART = 0.125
#: Number of halvings of the last step: Newton's method then finds the only equilibrium in it.
_HALVED = 4

#: Path of the numbers by which a film is uneven.
_GRADIENT = "membrane.thickness_gradient"

#: Pairs of the components (ia) of ∂x/∂ξ, 0 ≤ p ≤ q < 6, of a symmetric 6 × 6 matrix.
_PAIRS = tuple(combinations_with_replacement(range(6), 2))


@dataclass(frozen=True, eq=False)
class ShapesAt:
    """Shapes of the nodes, (shapes, nodes, 3), at points.

    They are the same for all films.
    """

    sites: Sites
    shapes: AnyArray

    @cached_property
    def values(self) -> AnyArray:
        """Values of the shapes, (shapes, points, 3)."""
        return self.sites.at(self.shapes)

    @cached_property
    def slopes(self) -> AnyArray:
        """∂φ/∂ξ, shape (shapes, 6 × points)."""
        return self.sites.tangents(self.shapes).reshape(len(self.shapes), -1)

    @cached_property
    def _halves(self) -> tuple[AnyArray, AnyArray]:
        """Numbers of both shapes of each pair; each pair occurs once."""
        return np.triu_indices(len(self.shapes))

    @cached_property
    def products(self) -> AnyArray:
        """Products ∂φ/∂ξ times ∂φ/∂ξ.

        Rows are pairs of components and points, columns are pairs of shapes; each pair occurs once.
        """
        slopes = self.slopes.reshape(len(self.shapes), 6, -1)
        first, second = (slopes[half] for half in self._halves)
        result = np.empty((len(_PAIRS), slopes.shape[2], len(first)))
        for number, (p, q) in enumerate(_PAIRS):
            both = first[:, p] * second[:, q]
            if p != q:
                both += second[:, p] * first[:, q]
            result[number] = both.T
        return result.reshape(-1, len(first))

    @cached_property
    def swept(self) -> tuple[AnyArray, AnyArray]:
        """Volume above the frame's plane [m³], of degree two and three in the amplitudes.

        The first part is multiplied by the nodes of a film's mesh, (2 × nodes, shapes × shapes)
        [m²]. The second, (shapes, shapes, shapes), is the same for all films. Both are symmetric in
        the shapes.
        """
        sites, count = self.sites, len(self.shapes)
        x, y = self.slopes.reshape(count, 6, -1)[:, :4].reshape(count, 2, 2, -1).swapaxes(0, 1)
        heights = self.values[:, :, 2] * (sites.weights * sites.turns)
        along, across = sites.gather
        by_nodes = np.empty((2, len(self.shapes[0]), count, count))
        cubic = np.empty((count, count, count))
        for number, height in enumerate(heights):
            by_nodes[0, :, number] = along @ (height * y[:, 1]).T - across @ (height * y[:, 0]).T
            by_nodes[1, :, number] = across @ (height * x[:, 0]).T - along @ (height * x[:, 1]).T
            cubic[number] = (height * x[:, 0]) @ y[:, 1].T - (height * x[:, 1]) @ y[:, 0].T
        by_nodes = (by_nodes + by_nodes.swapaxes(2, 3)) / 2
        cubic = np.mean([cubic.transpose(order) for order in permutations(range(3))], axis=0)
        return by_nodes.reshape(-1, count * count), cubic

    def coupled(self, moduli: AnyArray) -> AnyArray:
        """Sum tangents, (states, shapes, shapes), from moduli by pairs, (states, 21, points)."""
        first, second = self._halves
        half = moduli.reshape(len(moduli), -1) @ self.products
        result = np.empty((len(moduli), *2 * (len(self.shapes),)))
        result[:, first, second] = half
        result[:, second, first] = half
        return result


@dataclass(frozen=True, eq=False)
class FilmsAt:
    """Films at points: their quantities that do not depend on the state.

    ``flat``: ∂X/∂ξ, (films, 4, points). ``frame``: ∂ξ/∂X times the prestretch, (films, 4, points);
    ∂x/∂ξ times it is F of the virgin film. ``volumes`` of virgin film [m³], (films, points); nan
    for films turned inside out. ``covered``: share under the electrode. ``thickness``: thickness of
    the virgin film over the stated one. The last two have the shape (films, points) if they are
    uneven; otherwise they are the same for all films.
    """

    shapes: ShapesAt
    flat: AnyArray
    frame: AnyArray
    volumes: AnyArray
    covered: AnyArray
    thickness: AnyArray

    @property
    def areas(self) -> AnyArray:
        """Mounted areas that the points represent [m²], (films, points)."""
        a, b, c, d = self.flat.transpose(1, 0, 2)
        return np.asarray(np.abs(a * d - b * c) * self.shapes.sites.weights)

    def uneven(self, films: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Select share under the electrode and relative thickness for states of films."""
        every = self.covered, self.thickness
        covered, thickness = (each[films] if each.ndim == 2 else each for each in every)
        return covered, thickness


@dataclass(frozen=True, eq=False)
class Films:
    """Many films: a ``specimen`` with ``columns`` that replace some numbers, (films,) each.

    ``rows``: parameters of their family, (films, names). ``nodes`` of their meshes [m], (films,
    nodes, 2). ``points`` and ``whole``: shapes at the representative points and at all points.
    ``loading``: actions on all films. ``spring``: additional spring on each plate [N/m], (films,).
    ``pressure``: gas pressure below each film [Pa], (films,). ``turns``: tilts about x and y of the
    plate that the shapes belong to, by the shapes [rad/m], (2, shapes). The films move along the
    last shapes of ``points`` and ``whole``, their bends, by squares of these tilts. ``tilting``:
    how plates of other sizes tilt and bend by them. ``shifts``: motions of the plate's centre along
    x and y by the shapes, (2, shapes).
    """

    specimen: Specimen
    rows: AnyArray
    columns: Mapping[str, AnyArray]
    nodes: AnyArray
    points: ShapesAt
    whole: ShapesAt
    loading: Loading
    spring: AnyArray
    pressure: AnyArray
    gap: AnyArray
    turns: AnyArray
    tilting: Tilting
    shifts: AnyArray

    def __len__(self) -> int:
        return len(self.nodes)

    @property
    def count(self) -> int:
        """Number of shapes, with the deflection's, without bends."""
        return int(self.turns.shape[1])

    @property
    def bends(self) -> bool:
        """Whether plates may tilt."""
        return len(self.whole.shapes) > self.count

    @cached_property
    def gas(self) -> bool:
        """Whether there is gas below some of the films."""
        return bool(self.pressure.any())

    def lift(self, films: AnyArray) -> AnyArray:
        """Differentiate the deflection where the force acts by q, (states, shapes)."""
        x, y = self.loading.arm
        tilts = each_of(self._tilts, films)
        lift: AnyArray = y * tilts[:, 0] - x * tilts[:, 1]
        lift[:, 0] += float(self.specimen.plate is not None)
        return lift

    def leverage(self, films: AnyArray) -> AnyArray:
        """Divide the lift by that of the plate's deflection, (states, shapes)."""
        return self.lift(films) / self.lever(films)[:, None]

    def lever(self, films: AnyArray) -> AnyArray:
        """Differentiate that point's deflection by the plate's, (states,); 1 without a plate."""
        lever = self.lift(films)[:, 0]
        return np.where(lever == 0, 1.0, lever)

    def tilts(self, films: AnyArray, q: AnyArray) -> AnyArray:
        """Compute the sines of the plates' tilts about x and y in states q, (states, 2)."""
        return np.asarray((each_of(self._tilts, films) @ q[..., None])[..., 0])

    @cached_property
    def _tilts(self) -> AnyArray:
        """Tilts of the films' plates by the shapes [rad/m], (films, 2, shapes)."""
        return np.asarray(self.tilting.slants @ self.turns)

    def along(self, films: AnyArray, q: AnyArray) -> AnyArray:
        """Add the bends' amplitudes to states q."""
        if not self.bends:
            return q
        return np.hstack([q, self.tilting.amplitudes(films, q @ self.turns.T)])

    def _by_turn(self, films: AnyArray, q: AnyArray) -> AnyArray:
        """Compute derivatives of the bends' amplitudes by q, (states, bends, shapes)."""
        return np.asarray(self.tilting.slopes(films, q @ self.turns.T) @ self.turns)

    def _condensed(self, films: AnyArray, q: AnyArray, forces: AnyArray) -> AnyArray:
        """Convert forces against all shapes to forces against q."""
        return np.asarray(forces[:, :self.count]
                          + self.by_bends(films, q, forces[:, self.count:]))

    def by_bends(self, films: AnyArray, q: AnyArray, forces: AnyArray) -> AnyArray:
        """Convert forces against the bends, (states, bends), to forces against q."""
        if not self.bends:
            return np.zeros(q.shape)
        return np.asarray(np.einsum("sm,smk->sk", forces, self._by_turn(films, q)))

    def _stiffened(self, films: AnyArray, q: AnyArray, forces: AnyArray, stiffness: AnyArray
                   ) -> AnyArray:
        """Convert derivatives of forces by all shapes to derivatives by q."""
        if not self.bends:
            return stiffness
        count, by = self.count, self._by_turn(films, q)
        mixed = stiffness[:, :count, count:] @ by
        bent = np.einsum("sm,smij->sij", forces[:, count:], each_of(self.tilting.bends, films))
        return np.asarray(stiffness[:, :count, :count] + mixed + mixed.swapaxes(1, 2)
                          + by.swapaxes(1, 2) @ stiffness[:, count:, count:] @ by
                          + self.turns.T @ bent @ self.turns)

    def some(self, films: Any) -> Specimen:
        """Build the specimen with the columns of some films, (films, 1) each.

        A single film has columns of shape (1, 1).
        """
        return self._alone if len(self) == 1 else self._with(films)

    @cached_property
    def _alone(self) -> Specimen:
        """Specimen of a single film."""
        return self._with(slice(None))

    def _with(self, films: Any) -> Specimen:
        arrays = {path: column[films][:, None] for path, column in self.columns.items()}
        made: Specimen = with_arrays(self.specimen, arrays)
        return made

    @cached_property
    def few(self) -> FilmsAt:
        """The films at the representative points."""
        return self.at(self.points)

    @cached_property
    def first(self) -> Films | None:
        """The first film where all are equal but for their voltages; None where they are not."""
        if len(self) == 1 or self.nodes.strides[0] or not all(map(is_share, self.columns)):
            return None
        return replace(self, rows=self.rows[:1], nodes=self.nodes[:1], columns={
            path: column[:1] for path, column in self.columns.items()})

    def at(self, shapes: ShapesAt) -> FilmsAt:
        """Compute the films' quantities at points."""
        if self.first is not None:
            one, count = self.first.at(shapes), len(self)
            flat, frame, volumes = (np.broadcast_to(array, (count, *array.shape[1:]))
                                    for array in (one.flat, one.frame, one.volumes))
            return replace(one, flat=flat, frame=frame, volumes=volumes)
        sites = shapes.sites
        flat = sites.tangents(self.nodes)
        a, b, c, d = flat.transpose(1, 0, 2)
        area = a * d - b * c
        sound = (area * sites.turns > 0).all(-1)
        film = self.some(slice(None)).membrane
        first, second = film.prestretch
        frame = np.stack([d / area * first, -b / area * second, -c / area * first,
                          a / area * second], 1)
        covered, thickness = self._uneven(sites)
        volumes = np.abs(area) * sites.weights * film.volume_per_area * thickness
        volumes[~sound] = np.nan
        return FilmsAt(shapes, flat, frame, volumes, covered, thickness)

    def _uneven(self, sites: Sites) -> tuple[AnyArray, AnyArray]:
        """Compute share under the electrode and relative thickness at points."""
        even = (self.specimen.membrane.thickness_gradient == (0.0, 0.0)
                and not any(path.startswith(_GRADIENT) for path in self.columns))
        if even and not self.specimen.electrode.patches:
            return sites.covered, np.ones(())
        specimen, (x, y) = self.some(slice(None)), sites.at(self.nodes).transpose(2, 0, 1)
        covered = sites.covered * np.broadcast_to(specimen.electrode.coverage(x, y), x.shape)
        return covered, np.broadcast_to(specimen.relative_thickness(x, y), x.shape)

    @cached_property
    def weight(self) -> AnyArray:
        """Weight of film and electrodes on the shapes [N], (films, shapes)."""
        if not self.loading.gravity:
            return np.zeros((len(self), self.count))
        if self.first is not None:
            return np.broadcast_to(self.first.weight, (len(self), self.count))
        return self.loading.gravity * self._masses @ self.whole.values[:self.count, :, 2].T

    @cached_property
    def nodal_weight(self) -> AnyArray:
        """Weight of film and electrodes on the nodes of the whole mesh, (films, nodes, 3)."""
        if self.first is not None:
            one = self.first.nodal_weight
            return np.broadcast_to(one, (len(self), *one.shape[1:]))
        result = np.zeros((*self.nodes.shape[:2], 3))
        if self.loading.gravity:
            result[..., 2] = self.loading.gravity * (self.whole.sites.spread @ self._masses.T).T
        return result

    @cached_property
    def _masses(self) -> AnyArray:
        """Mass at all quadrature points [kg], (films, points)."""
        if self.first is not None:
            return np.broadcast_to(self.first._masses, (len(self), len(self.whole.sites.cells)))
        specimen, whole = self.some(slice(None)), self.whole.sites
        film, electrode = specimen.membrane, specimen.electrode
        a, b, c, d = whole.tangents(self.nodes).transpose(1, 0, 2)
        covered, thickness = self._uneven(whole)
        per_area: Any = film.density * film.volume_per_area * thickness
        per_area = per_area + film.layers * electrode.mass * covered
        return np.asarray(np.abs(a * d - b * c) * whole.weights * per_area)

    @cached_property
    def inertia(self) -> AnyArray:
        """Mass matrix of the films' shapes [kg], (films, shapes, shapes); without plates."""
        if self.first is not None:
            one = self.first.inertia
            return np.broadcast_to(one, (len(self), *one.shape[1:]))
        there = self.whole.values[:self.count]
        products = np.einsum("kpi,lpi->pkl", there, there).reshape(there.shape[1], -1)
        return np.asarray((self._masses @ products).reshape(-1, self.count, self.count))

    @cached_property
    def volume(self) -> Volume:
        """Volume of the gas below the films and their plates."""
        by_nodes, cubic = self.whole.swept
        alike = not self.nodes.strides[0]
        nodes, sites = self.nodes[:1] if alike else self.nodes, self.whole.sites
        a, b, c, d = sites.tangents(nodes).transpose(1, 0, 2)
        flat = (a * d - b * c) * sites.turns * sites.weights
        linear = flat @ self.whole.values[..., 2].T
        square = (nodes.swapaxes(1, 2).reshape(len(nodes), -1) @ by_nodes).reshape(
            len(nodes), *2 * (len(cubic),))
        plates = plate_areas(self.specimen, self.columns, len(self))
        turns = np.zeros((len(self._tilts), 2, len(cubic)))
        turns[..., :self.count] = self._tilts
        return Volume(linear, square, cubic, plates, turns)

    def parts(self, films: AnyArray, points: int) -> Iterator[slice]:
        """Yield slices of states that are computed together."""
        step = max(1, _TOGETHER // points)
        return (slice(start, start + step) for start in range(0, len(films), step))

    def strain(self, at: FilmsAt, films: AnyArray, q: AnyArray) -> Strained:
        """Compute the deformation of states q of films, (states, shapes), at points."""
        x = (self.along(films, q) @ at.shapes.slopes).reshape(len(q), 6, -1)
        every = films if at.flat.strides[0] else slice(0, 1)  # films that share one mesh have one
        x[:, :4] += at.flat[every]
        frame = at.frame[every].transpose(1, 0, 2)
        x = x.transpose(1, 0, 2)
        # Columns of F along the virgin film's axes, component by component.
        columns = [[x[2 * i] * frame[along] + x[2 * i + 1] * frame[2 + along] for i in range(3)]
                   for along in range(2)]
        return Strained(frame, columns[0], columns[1])

    def pull(self, films: AnyArray, q: AnyArray, squared: AnyArray, share: float = 1.0
             ) -> tuple[AnyArray, AnyArray]:
        """Compute generalised forces of films [N], weight included, and derivatives by q.

        ``share``: share of the gas pressure that acts.
        """
        strained, stress, bend = self._stressed(films, q, squared, tangent=True)
        every = self._forces(strained, stress)
        whole = self.few.shapes.coupled(strained.moduli(stress, bend))
        if self.gas:
            pressure = share * self.pressure[films]
            by, second = self.volume.derivatives(films, self.along(films, q))
            every = every - pressure[:, None] * by
            whole -= pressure[:, None, None] * second
        stiffness = self._stiffened(films, q, every, whole)
        forces = self._condensed(films, q, every) - self.weight[films]
        push, bend = self.acting(films, q[:, 0])
        forces[:, 0] += push
        stiffness[:, 0, 0] += bend
        return forces, stiffness

    def acting(self, films: AnyArray, deflection: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Compute springs' and mechanisms' force on plates [N] and stiffness [N/m], (states,)."""
        _, push, bend = acting(self.loading.biases, deflection)
        spring = self.spring[films]
        return spring * deflection + push, spring + bend

    def carried_force(self, films: AnyArray, q: AnyArray, force: AnyArray) -> AnyArray:
        """Compute the forces that films carry [N].

        They are the forces on the plates, mechanisms and gas included.
        """
        carried = force - self.acting(films, q[:, 0])[0]
        if self.gas:
            by_deflection, _ = self.volume.of_plates(films, q[:, 0], self.tilts(films, q))
            carried = carried + self.pressure[films] * by_deflection
        return np.asarray(carried)

    def forces(self, films: AnyArray, q: AnyArray, squared: AnyArray, share: float = 1.0
               ) -> AnyArray:
        """Compute only the forces of :meth:`pull`."""
        strained, stress, _ = self._stressed(films, q, squared, tangent=False)
        every = self._forces(strained, stress)
        if self.gas:
            by = self.volume.first(films, self.along(films, q))
            every -= share * self.pressure[films, None] * by
        forces = self._condensed(films, q, every) - self.weight[films]
        forces[:, 0] += self.acting(films, q[:, 0])[0]
        return forces

    def _stressed(self, films: AnyArray, q: AnyArray, squared: AnyArray, *, tangent: bool
                  ) -> tuple[Strained, AnyArray, Any]:
        """Compute films at points, S and, if requested, ∂S/∂E, times volumes.

        Stress and strain refer to the virgin film.
        """
        at = self.few
        strained = self.strain(at, films, q)
        stored = self.density(at, films, squared).of_virgin(strained.c, tangent=tangent)
        volumes = at.volumes[films]
        bend = stored.tangent.transpose(2, 3, 0, 1) * volumes if tangent else None
        return strained, stored.stress.transpose(2, 0, 1) * volumes, bend

    def _forces(self, strained: Strained, stress: AnyArray) -> AnyArray:
        """Compute forces of the film against all shapes, (states, shapes and bends)."""
        by = strained.forces(stress).transpose(1, 0, 2)
        return np.asarray(by.reshape(len(by), -1) @ self.few.shapes.slopes.T)

    def density(self, at: FilmsAt, films: AnyArray, squared: AnyArray) -> FilmDensity:
        """Create the energy density of films without wrinkles at points.

        ``squared``: U² [V²], (states,).
        """
        covered, thickness = at.uneven(films)
        some = self.some(films)
        return FilmDensity(some, squared[:, None], covered, wrinkles=False, thickness=thickness,
                           share=some.electrode.share(at.shapes.sites.segments))

    def stored(self, films: AnyArray, q: AnyArray, squared: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Compute capacitance [F] and energy of films [J], (states,) each."""
        capacitance, energy = np.empty(len(q)), np.empty(len(q))
        at = self.few
        for part in self.parts(films, len(at.shapes.sites.cells)):
            some, volumes = films[part], at.volumes[films[part]]
            strained = self.strain(at, some, q[part])
            charged = self.density(at, some, np.ones(len(some))).maxwell
            capacitance[part] = -2 * (charged.derivatives(*strained.stretches)[0]
                                      * volumes).sum(-1)
            whole = self.density(at, some, squared[part]).of_virgin(strained.c, tangent=False)
            energy[part] = (whole.energy * volumes).sum(-1)
        return capacitance, energy

    def extremes(self, at: FilmsAt, films: AnyArray, q: AnyArray, squared: AnyArray) -> Extremes:
        """Find largest or smallest values of states at points; nan without a state."""
        found, sites = Extremes.none(len(q)), at.shapes.sites
        there = np.flatnonzero(np.isfinite(q).all(1))
        for part in self.parts(there, len(sites.cells)):
            some = there[part]
            found.put(some, Extremes.of(self.local(at, films[some], q[some], squared[some])))
        return found

    def least(self, field: Callable[[Any], AnyArray], at: FilmsAt, films: AnyArray, q: AnyArray,
              squared: AnyArray) -> AnyArray:
        """Find the least value of a limit state's field, (states,); nan without a state."""
        return self.measured(lambda here, _: field(LocalPoint(here)).min(1), at, films, q, squared)

    def measured(self, measure: Measure, at: FilmsAt, films: AnyArray, q: AnyArray,
                 squared: AnyArray) -> AnyArray:
        """Measure states at points, (states,); nan without a state."""
        result = np.full(len(q), np.nan)
        sound, sites = np.flatnonzero(np.isfinite(q).all(1)), at.shapes.sites
        for part in self.parts(sound, len(sites.cells)):
            some = sound[part]
            result[some] = measure(self.local(at, films[some], q[some], squared[some]), films[some])
        return result

    def local(self, at: FilmsAt, films: AnyArray, q: AnyArray, squared: AnyArray) -> LocalState:
        """Compute stretches, stresses and fields of states at points."""
        strained, film = self.strain(at, films, q), self.some(films).membrane
        first, second = strained.stretches
        law = film.material.derivatives(first, second)
        density = self.density(at, films, squared)
        whole = density.material.derivatives(first, second)
        _, w1, w2, *_ = whole
        stress_1, stress_2 = first * w1, second * w2
        firm = strong_ellipticity(first, second, whole)
        if not density.coaxial:
            found = density.of_virgin(strained.c, tangent=True)
            stress_1, stress_2 = strained.principal(found.stress)
            firm = acoustic_margin(strained.c, found.stress, found.tangent)
        within = lawful(film, first, second, law)
        sound = (firm > 0) & within
        covered, relative = at.uneven(films)
        thickness = film.thickness * relative / (first * second)
        electric = covered * density.share * np.sqrt(squared)[:, None] / thickness
        strength = np.full_like(electric, np.inf)
        if film.strength is not None:
            strength[:] = film.strength.field(first, second, thickness)
        return LocalState(
            stretch_1=first, stretch_2=second, thickness=thickness, stress_1=stress_1,
            stress_2=stress_2, electric_field=electric, breakdown_strength=strength, sound=sound,
            lawful=within)

    def balanced(self, films: AnyArray, force: AnyArray, squared: AnyArray, guess: AnyArray,
                 held: bool = False, share: float = 1.0) -> Balance:
        """Solve for equilibria near a guess; a ``held`` plate keeps its deflection.

        ``share``: share of the gas pressure that acts. The force that holds a plate acts where its
        weight does.

        One tangent is reused as long as its corrections decrease fast.
        """
        count = len(guess)
        balance = Balance(q=guess.copy(), sound=np.zeros(count, dtype=bool),
                          stiffness=np.full(count, np.nan), least=np.full(count, np.nan))
        active = np.flatnonzero(np.isfinite(self.few.volumes[films]).all(-1))
        task = _Task(films, force, squared, held, share)
        for _ in range(_TANGENTS):
            going = [self._approached(balance, active[part], task)
                     for part in self.parts(active, len(self.points.sites.cells))]
            active = np.concatenate(going) if going else active[:0]
            if not len(active):
                break
        return balance

    def _approached(self, balance: Balance, some: AnyArray, task: _Task) -> AnyArray:
        """Correct some states by their tangents; return those that need new ones."""
        films, squared, share = task.films, task.squared, task.share
        gap = np.broadcast_to(self.gap, len(self))[films]
        with np.errstate(all="ignore"):
            pull, stiffness = self.pull(films[some], balance.q[some], squared[some], share)
            pull -= self._carried(pull, some, task)
            turned = stiffness
            if task.held:
                lever = self.leverage(films[some])
                turned = stiffness - lever[..., None] * stiffness[:, :1]
                for part in (stiffness, turned):
                    part[:, 0, :], part[:, :, 0], part[:, 0, 0] = 0.0, 0.0, 1.0
            finite = np.isfinite(stiffness).all((1, 2)) & np.isfinite(pull).all(1)
            some, pull, stiffness = some[finite], pull[finite], stiffness[finite]
            firm, inverse = positive_definite(stiffness), np.linalg.inv(turned[finite])
            balance.stiffness[some] = 1 / inverse[:, 0, 0]
            balance.least[some] = 1 / np.linalg.norm(inverse, axis=(1, 2))
            going, before = [], np.full(len(some), np.inf)
            for correction in range(_CHORDS + 1):
                step = (inverse @ pull[..., None])[..., 0]
                size = np.abs(step).max(-1) / gap[some]
                fine = size < 1
                balance.q[some[fine]] -= step[fine]
                # After a correction with a new tangent its square remains; after others their ratio
                # decides.
                left = size * (size if not correction else size / before)
                ready = fine & (left < _LAST**2)
                balance.sound[some[ready]] = firm[ready]
                slow = fine & ~ready & (size > _SLOW * before)
                going.append(some[slow])
                on = fine & ~ready & ~slow
                some, firm, inverse, before = some[on], firm[on], inverse[on], size[on]
                if not len(some) or correction == _CHORDS:
                    break
                pull = self.forces(films[some], balance.q[some], squared[some], share)
                pull -= self._carried(pull, some, task)
        return np.concatenate([*going, some])

    def _carried(self, pull: AnyArray, some: AnyArray, task: _Task) -> AnyArray:
        """Compute what acts on the shapes of some states, from the pull of their films.

        A held plate is carried by the force that holds it, others by the given force.
        """
        films = task.films[some]
        if task.held:
            return np.asarray(pull[:, :1] * self.leverage(films))
        return np.asarray(task.force[some, None] * self.lift(films))

    def charged(self, films: AnyArray, force: AnyArray, q: AnyArray, squared: AnyArray,
                chords: int = 0
                ) -> Charged:
        """Correct states near equilibria by U² [V²], each plate at its deflection.

        There is one correction, and ``chords`` more with the same tangents. Rates are those of the
        given state. The ratio of successive corrections is about the first correction over the
        state.
        """
        pull, stiffness = self.pull(films, q, squared)
        scale = float(np.abs(squared).max())
        # Forces are linear in U².
        by_voltage = (self.forces(films, q, squared + scale) - pull) / scale
        firm = positive_definite(stiffness)
        inverse = np.linalg.inv(np.concatenate([by_voltage[..., None], stiffness[..., 1:]], -1))
        rates = -(inverse @ stiffness[..., :1])[..., 0]
        slope, rates[:, 0] = rates[:, 0].copy(), 1.0
        for correction in range(chords + 1):
            if correction:
                pull = self.forces(films, q, squared)
            pull -= force[:, None] * self.lift(films)
            step = (inverse @ pull[..., None])[..., 0]
            squared = squared - step[:, 0]
            step[:, 0] = 0.0
            q = q - step
        return Charged(q, np.maximum(squared, 0.0), rates, slope, inverse[:, 0, 0], firm)

    def first_rests(self, films: AnyArray, force: AnyArray, squared: AnyArray) -> Balance:
        """Find the first equilibria of plates loaded slowly, then charged slowly, from flat films.

        There may be several where mechanisms soften. A plate moves as long as the unbalanced force
        drives it on, and stops where this force changes its sign.
        """
        every = np.arange(len(films))
        drive, near = self._driving(films, np.zeros((len(films), self.count)), force, 0 * squared)
        way = np.sign(np.nan_to_num(drive))
        beyond = near.copy()
        for voltage in (0 * squared, squared):
            drive, near = self._driving(films, near, force, voltage)
            going, after = every[drive * way > 0], drive.copy()
            for _ in range(_MOST_MARCHED):
                if not len(going):
                    break
                ahead = near[going].copy()
                ahead[:, 0] += way[going] * self._stride
                found, held = self._driving(films[going], ahead, force[going], voltage[going])
                on = found * way[going] > 0
                near[going[on]], drive[going[on]] = held[on], found[on]
                beyond[going[~on]], after[going[~on]] = held[~on], found[~on]
                going = going[on]
        for _ in range(_HALVED):
            middle = (near + beyond) / 2
            found, held = self._driving(films, middle, force, squared)
            on = (found * way > 0)[:, None]
            near, beyond = np.where(on, held, near), np.where(on, beyond, held)
        balance = self.balanced(films, force, squared, (near + beyond) / 2)
        balance.sound[np.abs(balance.q[:, 0] - near[:, 0]) > self._stride] = False
        return balance

    def _driving(self, films: AnyArray, q: AnyArray, force: AnyArray, squared: AnyArray
                 ) -> tuple[AnyArray, AnyArray]:
        """Compute the unbalanced force of plates held at states q [N], and these states.

        The force is nan if a film has no stable shape.
        """
        held = self.balanced(films, force, squared, q, held=True)
        missing = force - self.forces(films, held.q, squared)[:, 0]
        return np.where(held.sound, missing, np.nan), held.q

    @cached_property
    def _stride(self) -> float:
        """Longest step of a plate that skips no interval where a mechanism softens [m]."""
        return float(min([*(_PART * (high - low) for low, high in self.loading.softening),
                          float(np.max(self.gap)) / _MARCHED]))

    def carried(self, films: AnyArray, force: AnyArray, squared: AnyArray, start: AnyArray,
                steps: int
                ) -> Balance:
        """Solve for states while loads rise from zero in ``steps`` steps each.

        Force and gas rise first, then the voltage.
        """
        q, sound = start, np.ones(len(start), dtype=bool)
        stiffness, least = np.full((2, len(start)), np.nan)
        for load in range(2):
            for share in np.linspace(0, 1, steps + 1)[1:]:
                some = np.flatnonzero(sound)
                voltages = squared[some] * (share if load else 0.0)
                risen = 1.0 if load else float(share)
                step = self.balanced(films[some], force[some] * risen, voltages, q[some],
                                     share=risen)
                q[some], sound[some] = step.q, step.sound
                stiffness[some], least[some] = step.stiffness, step.least
        return Balance(q, sound, stiffness, least)


@dataclass(frozen=True, eq=False)
class Volume:
    """Volume of the gas below films, a cubic polynomial in the amplitudes a of all their shapes.

    It is defined as in :func:`tympan.fem.membrane.loading.film_volume` and ``plate_volume``. Four
    terms are subtracted: ``linear``, (films, shapes), times a; ``square``, (films, shapes, shapes),
    times a twice; ``cubic``, (shapes, shapes, shapes), times a three times; and the part of the
    plates. For films on one mesh the first two arrays have only one film. The part of the plates is
    the ``plates``' area [m²], (films,), times the deflection, which is the first amplitude, times
    the normal's z: 1 minus half the square of the tilts. ``turns``: tilts by the shapes, (films, 2,
    shapes), of one film where all plates are alike.
    """

    linear: AnyArray
    square: AnyArray
    cubic: AnyArray
    plates: AnyArray
    turns: AnyArray

    def _of(self, films: AnyArray) -> tuple[AnyArray, AnyArray]:
        if len(self.linear) == 1:
            return self.linear, self.square
        return self.linear[films], self.square[films]

    def value(self, films: AnyArray, a: AnyArray) -> AnyArray:
        """Compute volumes [m³], (states,)."""
        linear, square = self._of(films)
        by = linear + ((square + np.tensordot(a, self.cubic, 1)) @ a[..., None])[..., 0]
        level, _ = self.of_plates(films, a[:, 0], self._turned(films, a))
        return np.asarray(level * a[:, 0] - (by * a).sum(1))

    def first(self, films: AnyArray, a: AnyArray) -> AnyArray:
        """Compute first derivatives by the amplitudes [m²], (states, shapes)."""
        linear, square = self._of(films)
        twice = 2 * square + 3 * np.tensordot(a, self.cubic, 1)
        return self._by(linear, twice, films, a)

    def derivatives(self, films: AnyArray, a: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Compute first and second derivatives by the amplitudes.

        Shapes (states, shapes) [m²] and (states, shapes, shapes) [m].
        """
        linear, square = self._of(films)
        cubes = 3 * np.tensordot(a, self.cubic, 1)
        twice, turns = 2 * square, each_of(self.turns, films)
        plate = self.plates[films]
        by_turn = (self._turned(films, a)[:, None] @ turns)[:, 0]
        second = -(twice + 2 * cubes)
        second[:, 0] += plate[:, None] * by_turn
        second[:, :, 0] += plate[:, None] * by_turn
        second += (plate * a[:, 0])[:, None, None] * (turns.swapaxes(1, 2) @ turns)
        return self._by(linear, twice + cubes, films, a), second

    def of_plates(self, films: AnyArray, deflection: AnyArray, turns: AnyArray) -> tuple[AnyArray,
                  AnyArray]:
        """Compute derivatives of the volume below plates by deflection and tilts.

        Shapes (states,) and (states, 2).
        """
        plates = self.plates[films]
        return -plates * (1 - (turns**2).sum(1) / 2), (plates * deflection)[:, None] * turns

    def _by(self, linear: AnyArray, twice: AnyArray, films: AnyArray, a: AnyArray) -> AnyArray:
        by = -(linear + (twice @ a[..., None])[..., 0])
        by_deflection, by_turns = self.of_plates(films, a[:, 0], self._turned(films, a))
        by[:, 0] += by_deflection
        return np.asarray(by + (by_turns[:, None] @ each_of(self.turns, films))[:, 0])

    def _turned(self, films: AnyArray, a: AnyArray) -> AnyArray:
        """Compute the tilts, (states, 2)."""
        return np.asarray((each_of(self.turns, films) @ a[..., None])[..., 0])


@dataclass(frozen=True, eq=False)
class LocalState:
    """Scalar fields at points, by the names of :class:`tympan.fem.results.fields.Fields`.

    They are principal stretches and true stresses [Pa], thickness [m], field and the film's
    strength [V/m]. ``lawful``: whether the film is within its law's range. ``sound``: whether it is
    also stable in its plane. All arrays have the shape (states, points).
    """

    stretch_1: AnyArray
    stretch_2: AnyArray
    thickness: AnyArray
    stress_1: AnyArray
    stress_2: AnyArray
    electric_field: AnyArray
    breakdown_strength: AnyArray
    sound: Mask
    lawful: Mask

    @property
    def breakdown_share(self) -> AnyArray:
        """Ratio of field to strength."""
        return self.electric_field / self.breakdown_strength


#: Function that measures states of films at points: a number for each state, (states,), from local
#: values and the numbers of the states' films.
Measure = Callable[[LocalState, AnyArray], AnyArray]


@dataclass(frozen=True, eq=False)
class LocalPoint:
    """Interface of films for limit states that depend on stretches and stresses."""

    fields: LocalState

    @property
    def pressed(self) -> LocalState:
        """Fields without wrinkles: films of a family are taut."""
        return self.fields


@dataclass(frozen=True, eq=False)
class Extremes:
    """Largest and smallest local values of films, (states,) each; nan without a state."""

    #: Largest principal stretch.
    stretch: AnyArray
    #: Largest true stress [Pa].
    stress: AnyArray
    #: Least true stress [Pa].
    tension: AnyArray
    #: Largest field [V/m].
    electric: AnyArray
    #: Largest share of the film's strength, at its weakest point.
    share: AnyArray
    #: Field at the weakest point [V/m].
    weakest_field: AnyArray
    #: Strength at the weakest point [V/m].
    weakest_strength: AnyArray
    #: Number of the weakest point.
    weakest: AnyArray
    #: Number of the point with the least true stress.
    loosest: AnyArray
    #: Mask of states that are stable in the film's plane and within the law's range at all points.
    sound: Mask
    #: Mask of states whose law is within its range at all points.
    lawful: Mask

    @classmethod
    def of(cls, here: LocalState) -> Self:
        """Find the extremes of states at points."""
        weakest = here.breakdown_share.argmax(1)
        at = np.arange(len(weakest)), weakest
        return cls(stretch=here.stretch_1.max(1), stress=here.stress_1.max(1),
                   tension=here.stress_2.min(1), electric=here.electric_field.max(1),
                   share=here.breakdown_share[at], weakest_field=here.electric_field[at],
                   weakest_strength=here.breakdown_strength[at], weakest=weakest,
                   loosest=here.stress_2.argmin(1), sound=np.all(here.sound, 1),
                   lawful=np.all(here.lawful, 1))

    @classmethod
    def none(cls, count: int) -> Self:
        """Create placeholder values of ``count`` missing states."""
        kinds = {"weakest": 0, "loosest": 0, "sound": False, "lawful": False}
        return cls(**{item.name: np.full(count, kinds.get(item.name, np.nan))
                      for item in fields(cls)})

    def put(self, some: AnyArray, other: Extremes) -> None:
        """Replace the values of some states by others."""
        for item in fields(self):
            getattr(self, item.name)[some] = getattr(other, item.name)


@dataclass(frozen=True, eq=False)
class Balance:
    """States q, whether each is a stable equilibrium, and the plate's stiffness there [N/m].

    ``least``: approximately the least stiffness against any motion along the shapes [N/m]. It is 0
    where a film pulls in. The plate's stiffness may jump there if other parts of the film move.
    """

    q: AnyArray
    sound: Mask
    stiffness: AnyArray
    least: AnyArray

    def put(self, some: AnyArray, other: Balance) -> None:
        """Replace the values of some states by others."""
        for item in fields(self):
            getattr(self, item.name)[some] = getattr(other, item.name)


@dataclass(frozen=True, eq=False)
class _Task:
    """Equilibria to be solved: of ``films``, by their numbers, under loads of each, (states,).

    ``force`` [N] and ``squared`` voltage [V²]. ``held``: plates keep their deflections. ``share``:
    share of the gas pressure that acts.
    """

    films: AnyArray
    force: AnyArray
    squared: AnyArray
    held: bool
    share: float


@dataclass(frozen=True, eq=False)
class Charged:
    """States q, (states, shapes), with plates at their deflections under U² [V²], (states,).

    ``rates``: derivatives of q by the plate's deflection. ``slope``: derivative of U² by the
    deflection. ``by_force``: derivative of U² by the force on a plate at constant deflection
    [V²/N]. ``firm``: whether the film resists any motion.
    """

    q: AnyArray
    squared: AnyArray
    rates: AnyArray
    slope: AnyArray
    by_force: AnyArray
    firm: Mask

    @property
    def stiffness(self) -> AnyArray:
        """Stiffness of the plates at these voltages [N/m]."""
        return -self.slope / self.by_force

    def some(self, chosen: Any) -> Charged:
        """Select some of the states, in the given order."""
        return Charged(*(getattr(self, item.name)[chosen] for item in fields(self)))

    def joined(self, other: Charged) -> Charged:
        """Join these states and others."""
        return Charged(*(np.concatenate([getattr(self, item.name), getattr(other, item.name)])
                         for item in fields(self)))


@dataclass(frozen=True, eq=False)
class Strained:
    """Films at points: frame (4, states, points) and both columns of F of the virgin film."""

    frame: AnyArray
    first: list[AnyArray]
    second: list[AnyArray]

    @cached_property
    def c(self) -> tuple[AnyArray, AnyArray, AnyArray]:
        """C₁₁, C₂₂, C₁₂ of the virgin film."""
        (a, b, c), (d, e, f) = self.first, self.second
        return a * a + b * b + c * c, d * d + e * e + f * f, a * d + b * e + c * f

    @property
    def stretches(self) -> tuple[AnyArray, AnyArray]:
        """Principal stretches λ₁ ≥ λ₂."""
        c11, c22, shear = self.c
        mean, half = (c11 + c22) / 2, (c11 - c22) / 2
        radius = np.sqrt(half * half + shear * shear)
        return np.sqrt(mean + radius), np.sqrt(mean - radius)

    def principal(self, stress: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Compute principal true stresses [Pa] from S of the virgin film, (…, 3).

        They are the eigenvalues of S C.
        """
        (c11, c22, c12), (s11, s22, s12) = self.c, np.moveaxis(stress, -1, 0)
        mean = (s11 * c11 + s22 * c22) / 2 + s12 * c12
        both = (s11 * s22 - s12 * s12) * (c11 * c22 - c12 * c12)
        radius = np.sqrt(np.maximum(mean * mean - both, 0.0))
        return mean + radius, mean - radius

    def forces(self, stress: AnyArray) -> AnyArray:
        """Compute forces against ∂x/∂ξ, (6, …), from stresses times volumes.

        The stresses have the shape (3, states, points).
        """
        along, across, shear = stress
        a, b, c, d = self.frame
        result = np.empty((6, *along.shape))
        for i in range(3):
            first = self.first[i] * along + self.second[i] * shear
            second = self.first[i] * shear + self.second[i] * across
            result[2 * i] = first * a + second * b
            result[2 * i + 1] = first * c + second * d
        return result

    def moduli(self, stress: AnyArray, bend: AnyArray) -> AnyArray:
        """Compute the derivatives of these forces by ∂x/∂ξ, (states, 21, points).

        Each pair of components occurs once. ``bend``: ∂S/∂E times volumes, (3, 3, states, points).
        """
        a, b, c, d = self.frame
        strain = []  # E by each component of ∂x/∂ξ, in Voigt form
        for i in range(3):
            first, second = self.first[i], self.second[i]
            for left, right in ((a, b), (c, d)):
                strain.append((first * left, second * right, first * right + second * left))
        along, across, shear = stress
        mixed = {(0, 0): along * a * a + across * b * b + 2 * shear * a * b,
                 (0, 1): along * a * c + across * b * d + shear * (a * d + b * c),
                 (1, 1): along * c * c + across * d * d + 2 * shear * c * d}
        result = np.empty((along.shape[0], len(_PAIRS), along.shape[1]))
        work: list[list[AnyArray]] = [
            [bend[0, v] * e[0] + bend[1, v] * e[1] + bend[2, v] * e[2] for v in range(3)]
            for e in strain]
        for number, (p, q) in enumerate(_PAIRS):
            value = work[p][0] * strain[q][0] + work[p][1] * strain[q][1]
            value += work[p][2] * strain[q][2]
            if p // 2 == q // 2:
                value += mixed[p % 2, q % 2]
            result[:, number] = value
        return result


def positive_definite(matrices: AnyArray) -> Mask:
    """Compute the mask of symmetric matrices (n, n) that are positive definite."""
    try:
        np.linalg.cholesky(matrices)
    except np.linalg.LinAlgError:
        return np.linalg.eigvalsh(matrices)[:, 0] > 0
    return np.ones(len(matrices), dtype=bool)
