"""Force laws from finite elements: films solved with the plate held, at the nodes of a grid."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.base.progress import PartsDone
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.equilibrium.constraints import held_plate
from tympan.fem.equilibrium.newton import NewtonSettings, Solution, newton, simplified_newton
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.solve import held
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import PlateMotion, State, turned
from tympan.fem.results.places import Places
from tympan.fem.results.segments import segment_capacitances
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Outline
from tympan.geometry.specimen import Plate, Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.diagnosis.reduced.axes import HeldFilm, with_shares
from tympan.studies.diagnosis.reduced.film_shape import ALONG, AROUND, COUNT, lattice_of
from tympan.studies.diagnosis.reduced.force_law import (
    SEGMENTS,
    ForceLaw,
    Grid,
    SampledForce,
)
from tympan.studies.diagnosis.reduced.growth import first_laws
from tympan.studies.effects import Setup
from tympan.studies.kept.store import Store, digest

#: Mesh for force laws: forces within 1e-4 of the limit, a fraction of any sensor's noise.
COARSE = Settings(mesh=MeshSettings(around_plate=8, growth=1.0, across=1.0))
#: Mesh on which force laws are checked.
FINE = Settings(mesh=MeshSettings(around_plate=16, growth=0.5, across=0.5))


def coarse(formula: str | None) -> Settings:
    """Make the settings for force laws, with a film in closed form if one is named."""
    return replace(COARSE, formula=formula)


def fine(formula: str | None) -> Settings:
    """Make the settings by which force laws are checked, likewise."""
    return replace(FINE, formula=formula)


#: Newton steps from node to node, with forces to 1e-6; where they fail there is rarely a state.
_NEAR = NewtonSettings(correction=1e-5, residual=1e-6, iterations=12, damping=0.05)

#: Numbers of steps from the nearest state, where Newton's method fails in one.
_STEPS = (2, 5)

#: Largest error of polynomials that weights are to reproduce: that of rounding.
_TOLD = 1e-8
#: Largest sum of the weights' magnitudes: by so much the error of what is known may grow.
_HEAVIEST = 4.0
#: Where a plate is mounted; turns are counted from there.
_MOUNTED = PlateMotion.rest()

#: Path steps where Newton's method fails at once; shorter ones are rarely worth their time.
_BOLD = PathSettings(shortest=0.1)

#: Least number of deflections and of voltages with a solution.
_FEWEST = 2

#: Values of solved films on disk, about 20 MB.
_FILMS = Store("films", 30_000)

#: Values with shapes, about 100 MB.
_SHAPES = Store("shapes", 1000)

#: Most films whose states this process keeps as starts for others.
_MOST = 24


class NotSampled(ArithmeticError):
    """The film has no equilibrium, or none was found, at a node of this U² [V²]."""

    @property
    def voltage_squared(self) -> float:
        """U² there [V²]."""
        return float(self.args[0])

    def __str__(self) -> str:
        voltage = self.voltage_squared**0.5
        return f"the film could not be solved with its plate held at {voltage:.4g} V"


@dataclass(frozen=True, eq=False)
class Nodes:
    """A film's model, its values as a force law's solver gives them, and its states.

    Without a plate the force is the pressure [Pa] that holds its centre.

    ``values`` have the shape (values, deflections, voltages), nan beyond the voltage at which it
    could not be solved; where shapes are wanted the lattice's displacements follow. ``states`` have
    the numbers of the grid's points.
    """

    model: Model
    values: Array
    states: dict[tuple[int, int], State] = field(default_factory=dict)


def at_nodes(film: HeldFilm, grid: Grid, near: Nodes | None = None, strict: bool = False,
             shapes: bool = False) -> Nodes:
    """Solve a film at the nodes of a grid, beginning from a similar one on the same mesh.

    With ``shapes`` displacements are included. Beyond the lowest voltage without solution at some
    deflection no node is tried. A :class:`NotSampled` where hardly any node has a solution, or, if
    ``strict``, where one has none.
    """
    if near is not None and near.model.meshed:
        model = replace(near.model, specimen=film.specimen, loading=film.loading)
    else:
        model = build_model(film.specimen, coarse(film.formula), film.loading)
    deflections, voltages_squared = grid.nodes
    rows, columns = grid.numbers
    nodes = Nodes(model, np.full((grid.first_of_shape, len(deflections), len(voltages_squared)),
                                 np.nan))
    nearest = _nearest_before(voltages_squared)
    row_numbers, column_numbers = rows.tolist(), columns.tolist()
    reached = len(voltages_squared)
    several = grid.first_of_shape - SEGMENTS
    driven = [_Driven.of(model, squared) for squared in voltages_squared]
    segmented = bool(model.specimen.electrode.names)
    terms, degrees = grid.of_voltage(voltages_squared), grid.degrees
    tangents = dict[int, Tangent | None]()
    for i, deflection in enumerate(deflections.tolist()):
        behind = [_behind(nodes, near, row_numbers[: i + 1], column) for column in column_numbers]
        found = dict[int, Array]()
        for j in range(reached):
            guess = _guess(behind, found, terms, degrees, j)
            last = nodes.states.get((row_numbers[i], column_numbers[nearest[j]])) if j else None
            # A row differs less from the one before than voltages within it do.
            tangent = tangents.get(j) or tangents.get(nearest[j])
            solution = _solved((driven[nearest[j]], driven[j]), guess, last, deflection,
                               film.gas_pressure, tangent)
            if solution is None:
                if strict:
                    raise NotSampled(driven[j].highest)
                reached = max(j, _FEWEST)
                break
            tangents[j], state = solution.tangent, solution.state
            push = state.force if film.specimen.plate is not None else -state.pressure
            of_segments = (segment_capacitances(driven[j].model, [state])[0] if segmented
                           else np.array([model.capacitance(state)]))
            nodes.values[:, i, j] = (push, of_segments.sum(), state.plate.tilt**2,
                                     *state.plate.slope, *of_segments[: several])
            nodes.states[row_numbers[i], column_numbers[j]] = state
            known = behind[j]
            found[j] = _vector(state) - (0.0 if known is None else known.vector)
    fewest = np.isfinite(nodes.values[0]).sum(1) >= _FEWEST
    if fewest.sum() < _FEWEST:
        raise NotSampled(float(grid.highest[_FEWEST - 1]))
    return with_shapes(nodes, grid) if shapes else nodes


def _nearest_before(voltages_squared: Array) -> list[int]:
    """Find the nearest earlier one of each U² [V²], of one electrode or of segments; 0 at first."""
    points = voltages_squared.reshape(len(voltages_squared), -1)
    return [int(np.argmin(((points[:number] - point) ** 2).sum(1))) if number else 0
            for number, point in enumerate(points)]


def with_shapes(nodes: Nodes, grid: Grid) -> Nodes:
    """Add the displacements of the lattice's points, (3 + COUNT, deflections, voltages)."""
    model, (rows, columns) = nodes.model, grid.numbers
    specimen = model.specimen
    lattice = _lattice_places(model.discretisation, specimen.frame, specimen.plate)
    shapes = np.full((COUNT, *nodes.values.shape[1:]), np.nan)
    for i, row in enumerate(rows.tolist()):
        for j, column in enumerate(columns.tolist()):
            state = nodes.states.get((row, column))
            if state is not None:
                shapes[:, i, j] = lattice.displacement(model, state).T.ravel()
    return replace(nodes, values=np.concatenate([nodes.values, shapes]))


@lru_cache(maxsize=32)
def _lattice_places(mesh: Discretisation, frame: Outline, plate: Plate) -> Places:
    """Locate the lattice's points in a mesh, once for all effects on the film alone."""
    return Places.of(mesh, lattice_of(frame, plate).flat)


def meshed_outlines(specimen: Specimen) -> tuple[object, ...]:
    """Collect everything that a specimen's mesh depends on."""
    electrode = specimen.electrode
    regions = tuple(replace(segment, share=1.0) for segment in electrode.segments)
    return (specimen.frame, specimen.plate, electrode.margin_frame, electrode.margin_plate,
            electrode.outline, regions, electrode.gap, specimen.mirror_planes)


@dataclass(frozen=True, eq=False)
class _Driven:
    """A film's model with U² [V²] applied, one or one of each segment, and the highest of them."""

    model: Model
    squared: Array
    highest: float

    @classmethod
    def of(cls, model: Model, squared: Any) -> _Driven:
        """Apply U² [V²] to a model."""
        segments, highest = model.specimen.electrode.segments, float(np.max(squared))
        if segments:
            every = np.broadcast_to(squared, len(segments)) / (highest or 1.0)
            model = replace(model, specimen=with_shares(model.specimen, np.sqrt(every)))
        return cls(model, np.asarray(squared), highest)


def _behind(nodes: Nodes, near: Nodes | None, rows: Sequence[int], column: int) -> _Behind | None:
    """Add what is known to be near a state of the last row: a similar film's, the row's before.

    None where neither is known; ``kind`` tells which of them are.
    """
    own = nodes.states.get((rows[-2], column)) if len(rows) > 1 else None
    similar = None if near is None else near.states.get((rows[-1], column))
    if near is None or similar is None:
        return None if own is None else _Behind("row", _vector(own))
    there = None if own is None else near.states.get((rows[-2], column))
    if own is None or there is None:
        return _Behind("film", _vector(similar))
    return _Behind("both", _vector(similar) + _vector(own) - _vector(there))


@dataclass(frozen=True, eq=False)
class _Behind:
    """A vector near that of a state, and the kind of states that it was made from."""

    kind: str
    vector: Array


def _vector(state: State) -> Array:
    """List a state's positions, the plate's motion and the force, all of which may be added."""
    plate = state.plate
    return np.concatenate([state.positions.ravel(), plate.translation, turned(plate, _MOUNTED),
                           [state.force]])


def _state(vector: Array) -> State:
    """Make the state of a vector."""
    *_, force = vector.tolist()
    return State(vector[:-7].reshape(-1, 3), _MOUNTED.moved(vector[-7:-1]), force=force)


def _guess(behind: Sequence[_Behind | None], found: Mapping[int, Array], terms: Array,
           degrees: Numbers, column: int) -> State | None:
    """Guess the state of a column: what is behind it, and what those ``found`` were beyond theirs.

    That is a smooth function of the voltages: ``terms``, (columns, terms), have the ``degrees``.
    None where nothing is known.
    """
    last = behind[column]
    kind = None if last is None else last.kind
    alike = [other for other in found
             if kind == (None if (each := behind[other]) is None else each.kind)]
    if last is None and not alike:
        return None
    vector = 0.0 if last is None else last.vector
    if alike:
        weights = _weights(terms[alike], terms[column], degrees)
        vector = vector + weights @ np.array([found[other] for other in alike])
    return _state(np.asarray(vector))


def _weights(known: Array, wanted: Array, degrees: Numbers) -> Array:
    """Weigh values at known terms so that they add up to that at wanted ones, to a degree.

    It is the highest one whose polynomials they determine without large weights; else the value at
    the nearest terms is taken.
    """
    for degree in range(int(degrees.max()), 0, -1):
        low = degrees <= degree
        if low.sum() <= len(known):
            weights = np.linalg.lstsq(known[:, low].T, wanted[low])[0]
            exact = np.abs(weights @ known[:, low] - wanted[low]).max() < _TOLD
            if exact and np.abs(weights).sum() < _HEAVIEST:
                return np.asarray(weights)
    low = degrees <= 1
    nearest = int(np.argmin(((known - wanted)[:, low] ** 2).sum(1)))
    return np.asarray(np.arange(len(known)) == nearest, float)


def _solved(ways: tuple[_Driven, _Driven], guess: State | None, last: State | None,
            deflection: float, pressure: float, tangent: Tangent | None = None) -> Solution | None:
    """Solve from a guess, else in steps from this row's ``last`` state, else from the flat film.

    ``ways``: how the last state is driven, and the one to solve for. ``tangent``: that of a state
    that is hardly another, which is tried first.
    """
    start, driven = ways
    model = driven.model
    guess, free = model.mounted() if guess is None else guess, (model.pushed_by,)

    def at(state: State, driven: _Driven) -> Solution:
        return newton(driven.model, state.under(voltage=driven.highest, pressure=pressure), free,
                      (held_plate(deflection),), _NEAR)

    simplified = None if tangent is None else simplified_newton(
        model, guess.under(voltage=driven.highest, pressure=pressure), free,
        (held_plate(deflection),), _NEAR, tangent)
    if simplified is not None:
        return simplified
    solution = at(guess, driven)
    for count in () if last is None else _STEPS:
        if solution.converged:
            break
        assert last is not None
        before = state = last
        for share in np.linspace(0, 1, count + 1)[1:]:
            further = 2 * state.positions - before.positions
            between = start.squared + share * (driven.squared - start.squared)
            solution = at(replace(state, positions=further), _Driven.of(model, between))
            if not solution.converged:
                break
            before, state = state, solution.state
    if solution.converged or last is not None:
        return solution if solution.converged else None
    begin = newton(model, model.mounted().under(pressure=pressure), free, (held_plate(0.0),))
    outcome = held(model, deflection, driven.highest**0.5, begin, _BOLD)
    return outcome.solution if outcome.status == "equilibrium" else None


@dataclass(frozen=True)
class FiniteElements:
    """The solver of films by finite elements, with ``shapes``; solutions are kept on disk.

    ``slopes``: the signs of the plates' slopes are read, so that no effect has an even sign.
    """

    shapes: bool = False
    slopes: bool = False

    @property
    def store(self) -> Store:
        return _SHAPES if self.shapes else _FILMS

    def stored(self, film: HeldFilm, grid: Grid) -> Array | None:
        key = _key(film, grid)
        shape = (grid.first_of_shape + self.shapes * COUNT, *map(len, grid.numbers))
        return None if key is None else self.store.read(
            key, lambda content: np.frombuffer(content).reshape(shape))

    def solved(self, film: HeldFilm, grid: Grid, near: Sequence[HeldFilm]) -> Array:
        if (values := self.stored(film, grid)) is not None:
            return values
        return self.kept(film, grid, at_nodes(film, grid, self._similar(film, grid, near),
                                              shapes=self.shapes))

    def kept(self, film: HeldFilm, grid: Grid, nodes: Nodes) -> Array:
        """Keep the values of a film on disk, and its states in this process."""
        _states[film, grid.deflection] = nodes
        _states.move_to_end((film, grid.deflection))
        while len(_states) > _MOST:
            _states.popitem(last=False)
        if (key := _key(film, grid)) is not None:
            values = np.ascontiguousarray(nodes.values, dtype=np.float64)
            self.store.keep(key, values.tobytes())
        return nodes.values

    def _similar(self, film: HeldFilm, grid: Grid, near: Sequence[HeldFilm]) -> Nodes | None:
        """Find the nearest solved film on the same mesh, else solve the farthest now."""
        mesh = meshed_outlines(film.specimen)
        alike = [other for other in near if meshed_outlines(other.specimen) == mesh]
        for other in reversed(alike):
            if (nodes := _states.get((other, grid.deflection))) is not None:
                return nodes
        if not alike:
            return None
        nodes = at_nodes(alike[0], grid, shapes=self.shapes)
        self.kept(alike[0], grid, nodes)
        return nodes


#: Nodes by film and largest deflection, the last used last.
_states: OrderedDict[tuple[HeldFilm, float], Nodes] = OrderedDict()


def _key(film: HeldFilm, grid: Grid) -> bytes | None:
    """Make a key from everything that a film's values depend on, without its name.

    None for a film in closed form: another formula may come under its name.
    """
    if film.formula is not None:
        return None
    nameless = replace(film, specimen=replace(film.specimen, name="film"))
    with suppress(TypeError):
        return digest(nameless, grid.nodes, COARSE, (ALONG, AROUND),
                      Path(__file__).read_text(encoding="utf-8"))
    return None


def nominal_law(setup: Setup, name: str, deflection: float, voltage_squared: float,
                solver: FiniteElements = FiniteElements()) -> ForceLaw:
    """Sample the force law of a film without effects up to a deflection [m] and a U² [V²], or less.

    It may reach a little further: the grid is :attr:`Grid.rounded`.
    """
    film = HeldFilm.of(setup, name)
    grid = Grid(deflection, voltage_squared, film.odd, segments=film.segments).rounded
    while True:
        try:
            values = solver.stored(film, grid)
            if values is None:
                values = solver.kept(film, grid, at_nodes(film, grid, strict=True,
                                                          shapes=solver.shapes))
        except NotSampled as error:
            grid = replace(grid, voltage_squared=min(0.9 * grid.voltage_squared,
                                                     error.voltage_squared))
            if grid.voltage_squared < 1.0:
                raise
        else:
            return ForceLaw(solver, grid, (), {(): SampledForce(grid, values)})


def force_laws(setup: Setup, grids: Sequence[Grid], workers: int = 1,
               progress: PartsDone = lambda done, all_of_them: None,
               solver: FiniteElements = FiniteElements()) -> tuple[ForceLaw, ...]:
    """Sample the force law of every specimen, with the axes of every effect in the library.

    With a ``solver`` of shapes displacements are included, and the axes of effects that only they
    show; with one of slopes those of effects that they show.

    Each effect is sampled alone, at sizes about its prior's; :mod:`growth` adds larger ones and
    several together.

    Raises
    ------
    NotSampled
        Where a film has no solution within its grid.
    """
    return first_laws(solver, setup, grids, workers, progress, solver.shapes, solver.slopes)
