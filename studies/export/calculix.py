"""A film as input of CalculiX: virgin, stretched, released, loaded."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import resources
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.base.units import METRE, drive_words, quantities_text
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.membrane.model import Model
from tympan.fem.rig import Rig, checked_load
from tympan.geometry.mesh import CurvedTriangles, from_flat, segmented, unfold
from tympan.geometry.mesher import MeshSettings, mesh_film
from tympan.geometry.specimen import Film, Specimen
from tympan.studies.case import failure_reason, voltage_ramp
from tympan.studies.driven import in_proportion
from tympan.studies.export.hyperelastic import BULK_RATIO, bulk_modulus, hyperelastic
from tympan.studies.files import write_text

#: First and largest increment of a load step and the growth between them: the fastest that
#: converges.
_INCREMENTS = "1e-3, 1., 1e-8, 0.12"
_CONTROLS = ("*CONTROLS, PARAMETERS=TIME INCREMENTATION\n"
             "4, 8, 9, 16, 10, 4, , 5, ,\n.25, .5, .75, .85, , , 2.")
_OUTPUT = ("*NODE PRINT, NSET={moving}, FREQUENCY=1000", "U", "*NODE PRINT, NSET=RIM, TOTALS=ONLY",
           "RF", "*NODE FILE", "U", "*EL FILE", "S")
_TONNE_PER_MM3 = 1e-12
_MPA_PER_PA = 1e-6

#: Thickness of the plate as a solid [mm]. It is arbitrary, as the plate is rigid.
_PLATE_THICKNESS = 2.0
#: Modulus of the plate [MPa]: rigid compared with a film of some 0.1 MPa.
_PLATE_MODULUS = 1e6

EquationTerm = tuple[int, int, float]


@dataclass(frozen=True, eq=False)
class FlatFilm:
    """The flat mounted film: ``points`` [m], (n, 2), ``triangles`` of six of them, (m, 6).

    Triangles list their corners counterclockwise, then the middles of the edges 12, 23, 31.
    ``plate`` and ``frame`` are the points on these edges, none on a film without plate; ``centre``
    is the plate's [m], or the point observed without a plate. ``thickness`` is that over the film's
    stated one, for all points or each.
    """

    points: Array
    triangles: Numbers
    plate: Numbers
    frame: Numbers
    centre: tuple[float, float] = (0.0, 0.0)
    thickness: Any = 1.0

    @classmethod
    def of(cls, mesh: CurvedTriangles, specimen: Specimen) -> FlatFilm:
        """Take the film from a second-order mesh of the whole."""
        points, triangles = mesh.doflocs.T, mesh.dofs.element_dofs.T.copy()
        clockwise = _areas(points, triangles) < 0
        triangles[clockwise] = triangles[clockwise][:, [0, 2, 1, 5, 4, 3]]
        plate, frame = (np.unique(mesh.dofs.get_facet_dofs(mesh.boundaries[name]).flatten())
                        if name in mesh.boundaries else np.zeros(0, dtype=np.int64)
                        for name in ("plate", "frame"))
        return cls(points, triangles, plate, frame, specimen.centre,
                   specimen.relative_thickness(*mesh.doflocs))

    @property
    def middle(self) -> int:
        """Point nearest to the centre."""
        return int(np.argmin(np.hypot(*(self.points - self.centre).T)))

    def fan(self) -> tuple[Array, Numbers]:
        """Divide the plate into triangles around its centre.

        The points are those of ``plate``, then the centre, then those halfway to it.
        """
        edges = self.triangles[:, [[0, 1, 3], [1, 2, 4], [2, 0, 5]]].reshape(-1, 3)
        on_plate = np.isin(edges, self.plate).all(axis=1)
        first, last, middle = np.searchsorted(self.plate, edges[on_plate]).T
        ends = np.column_stack([first, last])
        corners = np.unique(ends)
        centre = np.full(len(ends), len(self.plate))
        halfway = np.searchsorted(corners, ends) + len(self.plate) + 1
        rim = self.points[self.plate]
        points = np.vstack([rim, self.centre, (rim[corners] + self.centre) / 2])
        triangles = np.column_stack([last, first, centre, middle, halfway])
        if (_areas(points, triangles) <= 0).any():
            raise InputError("cannot be exported: its whole edge must be seen from its centre",
                             key="plate",
                             given=f"centre {quantities_text(self.centre, 'length')}")
        return points, triangles


@dataclass(frozen=True, eq=False)
class _Layer:
    """A layer of wedges [mm] over six-node triangles of flat points; nodes from ``first`` on.

    The lower nodes come first, then the upper ones, then those between corners. ``thickness`` is
    that of all points, or of each.
    """

    flat: Array
    triangles: Numbers
    thickness: Any
    first: int = 1

    @cached_property
    def corners(self) -> Numbers:
        return np.unique(self.triangles[:, :3])

    @cached_property
    def points(self) -> Array:
        """Nodes [mm], shape (nodes, 3)."""
        half = self.thickness / 2
        return np.vstack([_at(self.flat, -half), _at(self.flat, half),
                          _at(self.flat[self.corners], 0.0)])

    @property
    def end(self) -> int:
        """Number after the last node's."""
        return self.first + len(self.points)

    def faces(self, numbers: Any) -> tuple[Any, Any]:
        """Find the numbers of lower and upper nodes at points."""
        return numbers + self.first, numbers + self.first + len(self.flat)

    def between(self, numbers: Any) -> Any:
        """Find the numbers of nodes between the faces at corners."""
        return np.searchsorted(self.corners, numbers) + self.first + 2 * len(self.flat)

    def cards(self, name: str, first: int = 1) -> Iterator[str]:
        """Write the nodes, and elements from the number ``first`` on."""
        yield from (f"*NODE, NSET={name}", *_nodes(self.points, self.first))
        yield f"*ELEMENT, TYPE=C3D15, ELSET={name}"
        lower, upper = self.faces(self.triangles)
        upright = self.between(self.triangles[:, :3])
        wedges = np.hstack([lower[:, :3], upper[:, :3], lower[:, 3:], upper[:, 3:], upright])
        for number, wedge in enumerate(wedges.tolist(), start=first):
            yield ", ".join(map(str, (number, *wedge)))


@dataclass(frozen=True, eq=False)
class Step:
    """Loads at a step's end, with their words in the file.

    The plate carries a ``force`` [N] or is held at a ``deflection`` [m]. ``electric`` are forces on
    the sheet's points, (n, 3) [N]; ``pressure`` is that of a gas below film and plate [Pa].
    """

    words: str
    force: float = 0.0
    deflection: float | None = None
    electric: Array | None = None
    pressure: float = 0.0


def export_input(specimen: Specimen, settings: MeshSettings, folder: Path,
                 masses: Sequence[float] = (), voltages: Sequence[float] = (),
                 pressure: float = 0.0, segment_voltages: Sequence[Mapping[str, float]] = ()
                 ) -> Path:
    """Write the film as ``NAME.inp``, with a step for each mass [kg], then for each voltage [V].

    ``segment_voltages`` are those of the segments by name, a set for each voltage. Voltages ascend
    in each of their proportions, under the last mass, in standard gravity; a gas may have a
    ``pressure`` [Pa]. With gas and without mass, a first step has the gas alone. One film of a
    stack is written, under its part of the loads: all films of a stack move alike.

    Raises
    ------
    InputError
        Where the specimen has a property that CalculiX lacks, or no equilibrium under these loads.
    """
    if specimen.electrode.stiffness:
        raise InputError("cannot be exported: no solid here is free of stress when mounted",
                         key="electrode.stiffness", given=specimen.electrode.stiffness)
    if any(masses):
        specimen.needed_plate()
    for mass, voltage in product(masses or (0.0,), voltages or (0.0,)):
        checked_load(mass, voltage, pressure)
    films = in_proportion(replace(specimen, membrane=replace(specimen.membrane, layers=1)),
                          voltages, segment_voltages)
    planes = frozenset.intersection(*(film.mirror_planes for film, _ in films))
    part = from_flat(mesh_film(specimen, replace(settings, order=2), planes))
    # As symmetric as the film, so that its plate does not tilt.
    mesh = segmented(unfold(part, planes)[0], specimen)
    layers = specimen.membrane.layers
    rig = Rig(gas_pressure=pressure / layers)
    carried = masses or ((0.0,) if pressure else ())
    weights = [Step(_load_words(mass, layers, pressure), force=rig.force(mass / layers),
                    pressure=rig.gas_pressure) for mass in carried]
    actuated = [step for film, raised in films for step in _actuated(
        film, mesh, masses[-1] if masses else 0.0, layers, raised, rig)]
    sheet = FlatFilm.of(mesh, specimen)
    plate_area = float(specimen.plate_area)
    lines = film_input(specimen.name, sheet, films[0][0].membrane, [*weights, *actuated],
                       plate_area)
    file = folder / f"{specimen.name}.inp"
    write_text(file, "\n".join(lines) + "\n")
    return file


def _load_words(mass: float, layers: int, pressure: float) -> str:
    """Write mass and gas on a stack of films, and their parts on the film written."""
    def loads(count: int) -> str:
        gas = [f"{pressure / count:g} Pa"] if pressure else []
        return ", ".join([f"{mass / count * 1e3:g} g", *gas])

    return loads(1) + (f" on {layers} films, {loads(layers)} on this one" if layers > 1 else "")


def _actuated(specimen: Specimen, mesh: CurvedTriangles, mass: float, layers: int,
              voltages: Sequence[float], rig: Rig) -> Iterator[Step]:
    """Make steps of the electric forces of the same mesh at its equilibria.

    The mass [kg] is that on all ``layers``; the specimen is one of these films, on its own rig.
    """
    own, pressure = mass / layers, rig.gas_pressure
    model = Model(Discretisation.of(mesh), specimen, rig.loading)
    for case, outcome in voltage_ramp(model, own, voltages, rig, PathSettings()):
        if outcome.status != "equilibrium":
            raise InputError(f"must have an equilibrium: {failure_reason(outcome)}",
                             key="--voltage", given=f"{case.voltage / 1e3:g} kV")
        state = outcome.state
        electric = (model.forces(state.positions, 0.0)
                    - model.forces(state.positions, state.voltage_squared))
        words = _load_words(mass, layers, pressure * layers)
        driven = drive_words(specimen.electrode.voltages(case.voltage))
        yield Step(f"{words}, {driven or f'{case.voltage / 1e3:g} kV'}", rig.force(own), None,
                   electric, pressure)


def film_input(name: str, sheet: FlatFilm, film: Film, steps: Sequence[Step],
               plate_area: float = 0.0) -> Iterator[str]:
    """Write an input file: stretch the film, release all but the rims, then the steps.

    ``plate_area`` [m²] is the area on which a gas lifts the plate.
    """
    assembly = _Assembly(sheet, film, plate_area)
    output = [line.format(moving="PLATE" if len(sheet.plate) else "CENTRE") for line in _OUTPUT]
    yield _preamble(name, film, steps)
    yield from assembly.cards()
    yield from _stage("1., 1.", [*assembly.mounted(), *assembly.hold_film()])
    yield from _stage("1., 1.", assembly.mounted())
    for step in steps:
        yield from _stage(f"{_INCREMENTS}\n{_CONTROLS}", assembly.loaded(step), output)


def _preamble(name: str, film: Film, steps: Sequence[Step]) -> str:
    text = resources.files("tympan.studies.export").joinpath("calculix.txt")
    listed = "\n".join(f"**   {number}: {step.words}" for number, step in enumerate(steps, start=3))
    return text.read_text(encoding="utf-8").rstrip("\n").format(
        name=name, steps=listed or "**   none", law=film.material.law, bulk=BULK_RATIO)


@dataclass(frozen=True)
class _Assembly:
    """The virgin film, the plate in its mounted position, and the node that mounts the film."""

    sheet: FlatFilm
    film: Film
    plate_area: float

    @cached_property
    def skin(self) -> _Layer:
        """The virgin film."""
        flat = METRE * self.sheet.points / np.array(self.film.prestretch)
        return _Layer(flat, self.sheet.triangles,
                      METRE * self.film.thickness * self.sheet.thickness)

    @property
    def has_plate(self) -> bool:
        return bool(len(self.sheet.plate))

    @property
    def mount(self) -> int:
        """Number of the node that mounts the film."""
        return self.plate.end if self.has_plate else self.skin.end

    @cached_property
    def plate(self) -> _Layer:
        points, triangles = self.sheet.fan()
        return _Layer(METRE * points, triangles, _PLATE_THICKNESS, self.skin.end)

    @property
    def centre(self) -> int:
        """Number of the node in the plate's centre."""
        return int(self.plate.between(len(self.sheet.plate)))

    @property
    def stretches(self) -> Array:
        """Stretches of the penalised film with free faces, shape (3,).

        Its pressure (σ₁ + σ₂)/3 gives it the volume J = 1 + pressure/K, up to the square of that.
        """
        l1, l2 = self.film.prestretch
        material: Any = self.film.material
        _, w1, w2, *_ = material.derivatives(np.asarray(l1), np.asarray(l2))
        pressure = float(l1 * w1 + l2 * w2) / 3
        return np.array([l1, l2, (1 + pressure / bulk_modulus(material)) / (l1 * l2)])

    def cards(self) -> Iterator[str]:
        """Write nodes, elements, materials, and the connections of rims, plate and mounting."""
        yield from self.skin.cards("FILM")
        if self.has_plate:
            yield from self.plate.cards("PLATE", len(self.sheet.triangles) + 1)
            yield from ("*NSET, NSET=REF", f"{self.centre},")
        else:
            yield from ("*NSET, NSET=CENTRE", *(f"{node}," for node in self.skin.faces(
                self.sheet.middle)))
        yield from ("*NODE, NSET=MOUNT", f"{self.mount}, 0., 0., 0.")
        rim = self.sheet.plate if self.has_plate else self.sheet.frame
        corners = np.intersect1d(rim, self.skin.corners)
        edge = [*self.skin.faces(rim), self.skin.between(corners)]
        yield from ("*NSET, NSET=RIM", *(f"{node}," for node in np.hstack(edge)))
        yield from ("*MATERIAL, NAME=RUBBER", *hyperelastic(self.film.material))
        if self.film.density:
            yield from ("*DENSITY", f"{self.film.density * _TONNE_PER_MM3:.12g}")
        yield "*SOLID SECTION, ELSET=FILM, MATERIAL=RUBBER"
        if self.has_plate:
            yield from ("*MATERIAL, NAME=STIFF", "*ELASTIC", f"{_PLATE_MODULUS:g}, 0.3",
                        "*SOLID SECTION, ELSET=PLATE, MATERIAL=STIFF")
        yield from self._hinges()

    def _hinges(self) -> Iterator[str]:
        """Write equations that tie a rim's mean between its faces to mounting and plate."""
        carriers: dict[int, Any] = {}
        if self.has_plate:
            rim = self.sheet.plate
            below, above = self.plate.faces(np.arange(len(rim)))
            carriers = dict(zip(rim.tolist(), zip(below, above, strict=True), strict=True))
        for point in (*self.sheet.frame.tolist(), *self.sheet.plate.tolist()):
            pairs: list[tuple[int, ...]] = [self.skin.faces(point)]
            if point in self.skin.corners:
                pairs.append((int(self.skin.between(point)),))
            for nodes in pairs:
                yield from self._hinge(nodes, point, carriers.get(point, ()))

    def _hinge(self, nodes: tuple[int, ...], point: int, carriers: tuple[int, ...]
               ) -> Iterator[str]:
        count = len(nodes)
        for k in (1, 2, 3):
            mounting = self.skin.flat[point, k - 1] if k < 3 else 0.0
            yield from _equation([*((node, k, 1.0) for node in nodes),
                                  *((node, k, -count / 2) for node in carriers),
                                  (self.mount, k, -count * mounting)])

    def mounted(self) -> list[str]:
        """Hold the plate and stretch the rims."""
        return [*self._stretched_rims(), *["PLATE, 1, 3"][:self.has_plate]]

    def _stretched_rims(self) -> list[str]:
        mount = self.mount
        along = [f"{mount}, {k}, {k}, {stretch - 1:.12g}"
                 for k, stretch in enumerate(self.film.prestretch, start=1)]
        return [*along, f"{mount}, 3, 3"]

    def hold_film(self) -> Iterator[str]:
        """Hold all nodes of the film, except those set by equations, in the flat mounted film."""
        rim = np.concatenate([self.sheet.plate, self.sheet.frame])
        dependent = np.hstack([self.skin.faces(rim)[0],
                               self.skin.between(np.intersect1d(rim, self.skin.corners))])
        numbers = np.arange(self.skin.first, self.skin.end)
        free = ~np.isin(numbers, dependent)
        displacements = self.skin.points[free] * (self.stretches - 1)
        for number, row in zip(numbers[free].tolist(), displacements.tolist(), strict=True):
            for k, displacement in enumerate(row, start=1):
                yield f"{number}, {k}, {k}, {displacement:.12g}"

    def loaded(self, step: Step) -> Iterator[str]:
        """Write boundary conditions and loads at a step's end."""
        yield from self._stretched_rims()
        if step.deflection is not None:
            yield from ("PLATE, 1, 2", f"PLATE, 3, 3, {METRE * step.deflection:.12g}")
        forces = [f"{node}, {k}, {force:.12g}" for node, k, force in self._forces(step) if force]
        if forces:
            yield from ("*CLOAD, OP=NEW", *forces)
        spread = []
        if self.film.density:
            spread.append(f"FILM, GRAV, {METRE * Rig().gravity:.12g}, 0., 0., 1.")
        if step.pressure:  # on the face towards the load
            spread.append(f"FILM, P2, {_MPA_PER_PA * step.pressure:.12g}")
        if spread:
            yield from ("*DLOAD, OP=NEW", *spread)

    def _forces(self, step: Step) -> Iterator[EquationTerm]:
        """List forces [N] on nodes, half of each electric one on either face."""
        if self.has_plate:
            yield self.centre, 3, step.force - step.pressure * self.plate_area
        if step.electric is None:
            return
        inside = np.setdiff1d(np.arange(len(step.electric)),
                              np.concatenate([self.sheet.plate, self.sheet.frame]))
        parts = [(self.skin, inside, inside)]
        if self.has_plate:
            parts.append((self.plate, np.arange(len(self.sheet.plate)), self.sheet.plate))
        for layer, at, points in parts:
            for nodes in layer.faces(at):
                for node, force in zip(nodes.tolist(), step.electric[points].tolist(), strict=True):
                    yield from ((node, k, push / 2) for k, push in enumerate(force, start=1))


def _areas(points: Array, triangles: Numbers) -> Array:
    """Compute twice the signed areas between corners."""
    first, second, third = np.moveaxis(points[triangles[:, :3]], 1, 0)
    (ax, ay), (bx, by) = (second - first).T, (third - first).T
    return np.asarray(ax * by - ay * bx)


def _at(flat: Array, height: Any) -> Array:
    return np.column_stack([flat, np.broadcast_to(height, len(flat))])


def _nodes(points: Array, first: int) -> Iterator[str]:
    """Write node lines from the number ``first``; CalculiX reads at most 20 characters a number."""
    for number, point in enumerate(points.tolist(), start=first):
        yield f"{number}, " + ", ".join(f"{x:.12g}" for x in point)


def _equation(terms: Sequence[EquationTerm]) -> Iterator[str]:
    nonzero = [term for term in terms if term[2]]
    yield from ("*EQUATION", str(len(nonzero)))
    yield ", ".join(f"{node}, {direction}, {factor:.12g}" for node, direction, factor in nonzero)


def _stage(increments: str, loads: Iterable[str], output: Sequence[str] = ()) -> Iterator[str]:
    """Write one static step that holds only what is given."""
    yield from ("*STEP, NLGEOM, INC=1000", "*STATIC", increments)
    yield from ("*BOUNDARY, OP=NEW", *loads, *output, "*END STEP")
