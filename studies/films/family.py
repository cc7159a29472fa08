"""Family of films that differ only in numbers, made from a few finite-element films; its error.

    box = {"frame.semi_axes.0": (0.05, 0.08), "membrane.thickness": (0.95e-3, 1.05e-3)}
    family = FilmFamily.around(specimen, box, force=(0.1, 0.3), voltage=(0.0, 6e3))
    states = family.states(parameters, forces, voltages)

Finite-element films are solved at a few places of the box, on one mesh that moves with the
outlines. The first places are random; the next ones are where the family's own error estimate is
largest. All other films follow from the shapes and forces of these films
(:class:`tympan.studies.films.reduction.Reduction`). Finally some random films are solved that the
family was not made from. The estimate is scaled so that it covers the errors of all of these.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from tympan.base.arrays import AnyArray, Mask
from tympan.base.errors import InputError
from tympan.base.fields import FieldsAlone
from tympan.base.points import drawn_points
from tympan.fem.derivatives.shape import motion_between, velocity
from tympan.fem.equilibrium.newton import Solution, moved, newton, simplified_newton
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.biases import Spring
from tympan.fem.membrane.formula import Formula
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import FREEDOMS, Load, PlateMotion, State
from tympan.fem.results.fields import node_fields
from tympan.fem.results.limit_states import BREAKDOWN, PULL_IN, TENSION
from tympan.fem.rig import Loads, Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, bare_film, meshed, mirror_planes, solved_loading
from tympan.studies.films.box import PRESSURE, Box, between
from tympan.studies.films.check import ResidualCheck
from tympan.studies.films.first_limits import (
    ENDS,
    WITHIN,
    FilmMargins,
    FirstLimits,
    first_limits,
    kinds,
    strained,
)
from tympan.studies.films.formula_films import FormulaFilms
from tympan.studies.films.many_films import (
    Balance,
    Films,
    FilmsAt,
    Measure,
    ShapesAt,
    positive_definite,
)
from tympan.studies.films.reduction import Reduction, Snapshot, plate_freedoms
from tympan.studies.films.sites import Sites
from tympan.studies.films.states import FilmEnds, FilmStates
from tympan.studies.films.tilting import TURNS, Tilting


@dataclass(frozen=True)
class FamilySettings:
    """Settings for making a family.

    ``error``: allowed error as a share of the deflection, or of 0.3 of the largest one, according
    to the estimate; it determines the number of shapes. ``first``: number of random films at the
    start, and ``more`` for each parameter. ``batch``: number of films added together where the
    estimate is largest, at most ``rounds`` times. ``candidates``: number of random films among
    which these are searched. ``checks``: number of random films that scale the estimate. ``seed``:
    seed of all random films.
    """

    error: float = 2e-5
    first: int = 6
    more: int = 1
    batch: int = 8
    rounds: int = 6
    candidates: int = 256
    checks: int = 40
    seed: int = 1


#: Part of a deformation that the shapes do not contain, over the largest one. It changes the
#: deflection by some 1e-5, because the deflection is stationary in the shapes. With a larger
#: allowed error it grows with the root of the error.
_MOTION = 1e-4
#: Part of the forces that the points do not reproduce; the deflection's error is proportional to
#: it. If it grew with the allowed error, plates that hardly move would be off by 1e-7 m.
_WORK = 2e-5
#: Weight of the remaining resistance of softening films relative to forces: points reproduce it to
#: 1e-3. Without it films of an Ogden law with α = 1.6 pull in at 7 % less voltage than with finite
#: elements, with it at 0.3 % less. Films of VHB then have 58 points instead of 49.
_SOFTENING = 0.02
#: Largest number of shapes: the cost of a tangent grows with its square.
_MOST = 24
#: Largest ratio of the largest estimate to that of the round before for which a family of that many
#: shapes gets further films: it hardly gains by them.
_GAINED = 0.5

#: Part of a load's range that scales the rate of a state's motion to a motion.
_RATE = 0.3

#: Tilt of a plate by a moment, over the deflection's over the frame's half extent.
_TURN = 0.1

#: Number of load steps if there is no good guess.
_STEPS = 4


#: Number of films that are computed together: their quadrature points take some 100 MB.
BLOCK = 500

#: Largest distance of a node's value from a film's largest value, relative to the range in the
#: film, for which the node is evaluated: with other parameters it may have the largest value. With
#: 0.1 all of 30,000 states of a wide sweep have the same values; with 0.01 stresses are off by
#: 6e-5.
_NEARLY = 0.03

#: Safety factor of the error estimate, in addition to covering the errors of the test films.
#: Without it one of the same number of further films would exceed the estimate.
_MARGIN = 1.5
#: Factor for the error of the largest stress: with half of it 88 of 30,000 films had larger errors,
#: at most 1.8 times as large.
_STRESS_MARGIN = 2 * _MARGIN

#: Error relative to the deflection above which a state gets its own estimate instead of its film's
#: largest one; sweeps use finite elements for such states.
_LARGE = 1e-4

#: Least deflection for relative errors, over the largest of the family: plates that gas lifts or
#: mechanisms hold may be flat.
_LEVEL = 0.3

#: Step, relative to the load reached, below which the search for a first film's state is given up:
#: a film so near its end is dear, and the family hardly better with it.
_GIVEN_UP = 0.25

#: Least tension, over the largest stress, of films that finite elements also find in tension.
_TENSE = 1e-3

#: Number of random films that are solved on meshes of their own.
_REMESHED = 4


@dataclass(frozen=True, eq=False)
class Ground(FieldsAlone):
    """Finite elements of a family: the mesh of one of its films, which moves to the others.

    ``pressure``: gas pressure below films that do not differ in it [Pa].
    """

    box: Box
    model: Model
    settings: Settings
    pressure: float = 0.0

    @property
    def path(self) -> PathSettings:
        """Settings of the search for equilibria."""
        return self.settings.path

    @classmethod
    def of(cls, box: Box, loads: Loads, settings: Settings) -> Ground:
        """Mesh the box's specimen, with the mirror planes that all films of the box share."""
        planes = (mirror_planes(box.specimen, loads.loading)
                  & mirror_planes(box.general, loads.loading))
        require_reducible(box.specimen, loads)
        model = bare_film(box.specimen, settings, planes)
        return cls(box, replace(model, loading=solved_loading(loads.loading, settings)),
                   settings, loads.gas_pressure)

    def film(self, row: AnyArray) -> Model:
        """Build the film with given parameters on the moved mesh."""
        specimen, mesh = self.box.member(row), self.model.discretisation
        if self.box.lengths:
            mesh = mesh.moved(self._moved(row))
        return replace(self.model, discretisation=mesh, specimen=specimen,
                       loading=self._loading(row))

    def fresh(self, row: AnyArray) -> Model:
        """Build the film with given parameters on a mesh of its own."""
        own = meshed(self.box.member(row), self.settings, self.model.discretisation.planes)
        return replace(own, loading=self._loading(row))

    def _loading(self, row: AnyArray) -> Loading:
        """Add the spring of a film to the rig's loading."""
        loading, spring = self.model.loading, float(self.box.springs(row[None])[0])
        return replace(loading, biases=(*loading.biases, Spring(spring))) if spring else loading

    def gas(self, row: AnyArray) -> float:
        """Compute the gas pressure below a film [Pa]."""
        return float(self.box.pressures(row[None], self.pressure)[0])

    def _motion(self, row: AnyArray) -> AnyArray:
        return motion_between(self.model.discretisation, self.box.specimen, self.box.member(row))

    def _moved(self, row: AnyArray) -> AnyArray:
        """Compute the motion of the mesh's nodes to a film, (nodes, 2) [m]; some are kept."""
        key = row[self._lengths].tobytes()
        if key not in self._kept:
            if len(self._kept) >= 2 * BLOCK:
                self._kept.clear()
            self._kept[key] = self._motion(row)
        return self._kept[key]

    @cached_property
    def _kept(self) -> dict[bytes, AnyArray]:
        """Motions of the mesh's nodes to some films, by their lengths."""
        return {}

    @cached_property
    def _lengths(self) -> list[int]:
        """Columns of the films' parameters that are lengths."""
        return [self.box.names.index(name) for name in self.box.lengths]

    def nodes(self, rows: AnyArray) -> AnyArray:
        """Compute the nodes of the films' meshes [m], (films, nodes, 2)."""
        flat = self.model.discretisation.reference[:, :2]
        if not self.box.lengths:
            return np.broadcast_to(flat, (len(rows), *flat.shape))
        if self._straight is None:
            return np.array([flat + self._moved(row) for row in rows])
        change = (rows - self.box.row(self.box.specimen))[:, self._lengths]
        return np.asarray(flat + np.tensordot(change, self._straight, 1))

    @cached_property
    def _straight(self) -> AnyArray | None:
        """Motions of the nodes by lengths, (lengths, nodes, 2); None if they are not linear.

        Edges of most outlines move in proportion to their lengths; those of a band do not.
        """
        mesh, box = self.model.discretisation, self.box
        by_length = np.array([velocity(mesh, box.specimen, tuple(name.split(".")))
                              for name in box.lengths])
        numbers = self._lengths
        for share in (0.0, 0.3, 1.0):
            row = box.row(box.specimen)
            row[numbers] = (box.low + share * (box.high - box.low))[numbers]
            motion = self._motion(row)
            change = row[numbers] - box.row(box.specimen)[numbers]
            if np.abs(motion - np.tensordot(change, by_length, 1)).max() > _STRAIGHT * self.size:
                return None
        return by_length

    @property
    def size(self) -> float:
        """Larger half extent of the frame [m]."""
        return self.model.size

    def tilting(self, reduction: Reduction, rows: AnyArray, nodes: AnyArray) -> Tilting:
        """Find how the films' plates tilt by shapes; ``nodes`` of their meshes [m]."""
        arms, columns = self.model.arms[None, :, :2], self.box.columns(rows)
        if self.box.lengths:
            centre = np.column_stack([
                np.broadcast_to(columns.get(f"plate.offset.{axis}", own), len(rows))
                for axis, own in enumerate(self.box.specimen.centre)])
            arms = nodes[:, self.model.discretisation.plate_nodes] - centre[:, None]
        return Tilting.of(reduction.arms[:, :2], arms, reduction.slides,
                          bool(self.model.discretisation.planes))

    def solved(self, row: AnyArray, force: float, squared: float, motion: AnyArray | None = None,
               partly: bool = False) -> tuple[Model, Solution] | None:
        """Solve a finite-element film; None unless it is taut and stable.

        The start is the flat film, or a guess of its nodes' displacements, (nodes, 3). A close
        guess takes one tangent. ``partly``: from the flat film, also take a state on the way to
        loads without equilibrium.
        """
        try:
            model = self.film(row)
        except InputError:
            return None
        if motion is None:
            # A plate that may snap needs small steps.
            settings = (self.path if model.loading.softening else
                        replace(self.path, handover=max(self.path.handover, _GIVEN_UP)))
            outcome = equilibrium(model, force, squared**0.5, self.gas(row), settings=settings,
                                  ends=False)
            solution = outcome.solution
            there = outcome.status == "equilibrium" or (partly and solution.stable)
        else:
            near = self._near(model, row, motion, force, squared)
            solution = (simplified_newton(model, near, settings=self.path.newton)
                        or newton(model, near, settings=self.path.newton))
            there = solution.converged and solution.stable
        return (model, solution) if there and model.in_tension(solution.state) else None

    def _near(self, model: Model, row: AnyArray, motion: AnyArray, force: float, squared: float
              ) -> State:
        freedoms = np.zeros(6)
        allowed = list(model.plate_freedoms)
        freedoms[allowed] = plate_freedoms(model, motion)[allowed]
        return State(model.discretisation.reference + motion,
                     PlateMotion.rest().moved(freedoms), squared, force, self.gas(row))


#: Number of the only film.
_ALONE = np.zeros(1, dtype=np.int64)

#: Largest nonlinearity of the nodes' motions, over the frame's half extent.
_STRAIGHT = 1e-9


def require_reducible(specimen: Specimen, loads: Loads) -> None:
    """Raise InputError for a held plate: its films have no deflection."""
    if specimen.plate is not None and loads.guide == "fixed":
        raise InputError("must let the plate move: held, it has no deflection in which films could "
                         "differ", key="rig.guide", given=loads.guide)


@dataclass(frozen=True, eq=False)
class RaisedFilms:
    """Films whose voltage is raised until a limit, under forces [N], (films,).

    ``at``: the points where stretches and fields are compared. ``strengths``: factors on the
    electric strength, (films,). ``wanted``: kinds of limits that are looked for.
    """

    films: Films
    at: FilmsAt
    forces: AnyArray
    strengths: AnyArray
    wanted: Collection[str]


@dataclass(frozen=True, eq=False)
class FilmFamily(FieldsAlone):
    """Films of a box of parameters, under forces and voltages of a range.

    ``force`` [N] and ``voltage`` [V]: lowest and highest, of the film itself. How the films are
    computed, a subclass says: from finite elements (:class:`ReducedFamily`), or by a formula
    (:class:`FormulaFamily`).
    """

    ground: Ground
    force: tuple[float, float]
    voltage: tuple[float, float]

    @classmethod
    def around(cls, specimen: Specimen, box: Mapping[str, Sequence[float | str]],
               force: Sequence[float | str], voltage: Sequence[float | str], rig: Rig = Rig(),
               settings: Settings = Settings(), family: FamilySettings = FamilySettings()
               ) -> FilmFamily:
        """Make the family of a specimen with limits of its numbers, by name, and of the loads.

        A name is the path of a number in the specimen, such as "frame.semi_axes.0" or
        "membrane.thickness". "stiffness" is a factor on all stresses of the law. "rig.spring" is a
        spring on the plate in addition to those of the rig. "rig.gas_pressure" is the gas pressure
        below film and plate instead of the rig's. ``force`` acts on the plate, ``voltage`` across
        the film. All limits are lowest and highest, in SI or with a unit.

        Raises
        ------
        InputError
            If specimen or rig have no reduced film, or no film of the box has an equilibrium.
        """
        return cls.over(Box.around(specimen, box), between(force, "force", "force"),
                        between(voltage, "voltage", "voltage"), rig, settings, family)

    @classmethod
    def over(cls, box: Box, force: tuple[float, float], voltage: tuple[float, float],
             rig: Rig = Rig(), settings: Settings = Settings(),
             family: FamilySettings = FamilySettings()) -> FilmFamily:
        """Make the family of a box under loads of a range."""
        ground = Ground.of(box, rig, settings)
        if settings.closed_form is not None:
            return FormulaFamily(ground, force, voltage, settings.closed_form)
        return _Making(ground, force, voltage, family).made()

    @property
    def box(self) -> Box:
        """Parameters of the family and their limits."""
        return self.ground.box

    def drawn(self, count: int, seed: int = 1) -> AnyArray:
        """Draw parameters of random films, evenly over the box, (count, names)."""
        return self.box.between(drawn_points(len(self.box.names), count, seed))

    def films(self, rows: AnyArray) -> Films:
        """Build the films with given parameters, rows of (films, names)."""
        raise NotImplementedError

    def blocks(self, parameters: Any) -> Iterator[tuple[slice, Films]]:
        """Yield films that are computed together, and their slice of all films.

        The result of :meth:`films` is one block. Quantities of films that do not depend on their
        state are computed once as long as these films are stored.
        """
        if isinstance(parameters, Films):
            yield slice(None), parameters
            return
        rows = np.atleast_2d(np.asarray(parameters, dtype=float))
        for start in range(0, len(rows), BLOCK):
            part = slice(start, start + BLOCK)
            yield part, self.films(rows[part])

    if TYPE_CHECKING:  # a subclass may have fields of these names
        @property
        def places(self) -> Sites:
            """Points at which some film has nearly its largest strain or field."""

        @property
        def looked_at(self) -> ShapesAt:
            """Shapes at these places."""

        @property
        def at_nodes(self) -> ShapesAt:
            """Shapes at the nodes of every element."""

        @property
        def whole(self) -> ShapesAt:
            """Shapes at all quadrature points."""

        @property
        def restressed(self) -> float:
            """Relative error of the largest stresses."""

        @property
        def tilted(self) -> float:
            """Error of the plates' slopes [rad]."""

        @property
        def unstable(self) -> int:
            """Number of random films that are unstable only by finite elements."""

    @property
    def measured(self) -> frozenset[str]:
        """Kinds of limits of whose margins the films have a number."""
        return frozenset(kinds())

    def states(self, parameters: Any, forces: Any, voltages: Any, check: bool = True,
               masses: Any = None, loose: bool = False) -> FilmStates:
        """Solve for equilibria under forces on the plates [N] and voltages across the films [V].

        ``parameters``: (films, names), in the order of ``family.box.names``, or the result of
        :meth:`films`. Forces, voltages and ``masses`` that move with the plates [kg] are broadcast
        to (films, states). Without ``check`` the error is not estimated and is nan. With ``loose``
        films that have lost tension are included, as if they bore compression: a search then knows
        how much tension is missing.
        """
        loads = np.broadcast_arrays(*(np.asarray(np.nan if value is None else value, float)
                                      for value in (forces, voltages, masses)))
        count = len(parameters) if isinstance(parameters, Films) else len(np.atleast_2d(parameters))
        shape = count, *np.broadcast_shapes(loads[0].shape, (1, 1))[1:]
        force, voltage, mass = (np.broadcast_to(value, shape) for value in loads)
        blocks = [self._states(films, force[part], voltage[part], mass[part], check, loose)
                  for part, films in self.blocks(parameters)]
        return FilmStates.joined(blocks, self, parameters)

    def extremes_of(self, parameters: Any, states: FilmStates,
                    local: Callable[[Any], AnyArray], sign: int) -> AnyArray:
        """Find the extremes of a local field at all nodes of the elements, (films, states).

        ``parameters`` are as for :meth:`states`. ``sign``: 1 for the largest, -1 for the least.
        """
        def measures(at: FilmsAt) -> Measure:
            return lambda here, films: sign * (sign * local(here)).max(1)

        return self._measured(parameters, states, self.at_nodes, measures)

    def means_of(self, parameters: Any, states: FilmStates, local: Callable[[Any], AnyArray],
                 covered: bool) -> AnyArray:
        """Average a local field over the mounted films, (films, states), or under the electrode.

        ``parameters`` are as for :meth:`states`. The points are all quadrature points.
        """
        def measures(at: FilmsAt) -> Measure:
            areas = at.areas * (at.covered if covered else 1.0)
            shares = areas / areas.sum(1, keepdims=True)
            return lambda here, films: (local(here) * shares[films]).sum(1)

        return self._measured(parameters, states, self.whole, measures)

    def _measured(self, parameters: Any, states: FilmStates, shapes: ShapesAt,
                  measures: Callable[[FilmsAt], Measure]) -> AnyArray:
        """Measure states of films at points, (films, states); nan where there is no state."""
        result = np.full(states.holds.shape, np.nan)
        for part, films in self.blocks(parameters):
            at, q = films.at(shapes), states.q[part]
            number = np.repeat(np.arange(len(q)), q.shape[1])
            found = films.measured(measures(at), at, number, q.reshape(len(number), -1),
                                   states.voltage[part].ravel() ** 2)
            result[part] = found.reshape(q.shape[:2])
        return result

    def rests(self, parameters: Any, forces: AnyArray, voltages: AnyArray) -> AnyArray:
        """Solve for amplitudes q of equilibria, (films, shapes), taut or not.

        ``parameters`` are as for :meth:`states`. Forces [N] and voltages [V] have the shape
        (films,). Amplitudes are nan if there is no equilibrium.
        """
        found = []
        for part, films in self.blocks(parameters):
            balance = self._rests(films, np.arange(len(films)), forces[part], voltages[part] ** 2)
            found.append(np.where(balance.sound[:, None], balance.q, np.nan))
        return np.concatenate(found)

    def held_forces(self, parameters: Any, q: AnyArray, voltages: AnyArray) -> AnyArray:
        """Compute the forces [N] that hold plates at states q, under voltages [V].

        ``parameters`` are as for :meth:`states`. ``q``: (films, shapes), one state per film. Forces
        are nan if there is no equilibrium.
        """
        result = np.full(len(q), np.nan)
        for part, films in self.blocks(parameters):
            number = np.flatnonzero(np.isfinite(q[part]).all(1))
            if not len(number):
                continue
            squared = voltages[part][number] ** 2
            balance = films.balanced(number, np.zeros(len(number)), squared, q[part][number],
                                     held=True)
            forces = films.forces(number, balance.q, squared)[:, 0] / films.lever(number)
            result[part][number] = np.where(balance.sound, forces, np.nan)
        return result

    def _states(self, films: Films, force: AnyArray, voltage: AnyArray, mass: AnyArray, check: bool,
                loose: bool) -> FilmStates:
        shape, rows = force.shape, films.rows
        number = np.repeat(np.arange(len(rows)), shape[1])
        force, voltage, mass = force.ravel(), voltage.ravel(), mass.ravel()
        squared = voltage**2
        balance = self._rests(films, number, force, squared)
        holds = balance.sound & self.box.holds(rows)[number] & self._loads_within(force, voltage)
        q = np.where(holds[:, None], balance.q, np.nan)
        extremes = films.extremes(films.at(self.looked_at), number, q, squared)
        slack = holds & ~(extremes.tension > 0)
        holds &= loose | ~slack
        q[~holds] = np.nan
        capacitance, energy = films.stored(number, q, squared)
        carried = np.where(holds, films.carried_force(number, q, force), np.nan)
        error = np.full(len(q), np.nan)
        if check:
            error = self._error(films, number, q, force, squared, balance.stiffness, shape)
        weakest, loosest = (self._placed(films, number, point)
                            for point in (extremes.weakest, extremes.loosest))
        values = {"voltage": np.abs(voltage), "deflection": q[:, 0], "force": carried,
                  "capacitance": capacitance, "energy": energy, "stiffness": balance.stiffness,
                  "error": error, "stretch": extremes.stretch, "stress": extremes.stress,
                  "tension": extremes.tension, "electric": extremes.electric,
                  "breakdown": extremes.share, "weakest_field": extremes.weakest_field,
                  "weakest_strength": extremes.weakest_strength,
                  "frequency": _frequency(films, number, q, squared, mass),
                  "stress_error": self.restressed * extremes.stress,
                  "slope_error": np.full(len(q), self.tilted if check else np.nan)}
        masked: dict[str, Any] = {name: np.where(holds, value, np.nan).reshape(shape)
                                  for name, value in values.items()}
        in_plane = {"slope": self._slope(films, number, q), "shift": self._shift(films, q),
                    "weakest": weakest, "loosest": loosest}
        pairs: dict[str, Any] = {name: np.where(holds[:, None], value, np.nan).reshape(*shape, 2)
                                 for name, value in in_plane.items()}
        return FilmStates(**masked, **pairs, holds=holds.reshape(shape),
                          slack=slack.reshape(shape), sound=extremes.sound.reshape(shape),
                          q=q.reshape(*shape, -1))

    def frequencies(self, parameters: Any, q: AnyArray, voltages: AnyArray, masses: AnyArray
                    ) -> AnyArray:
        """Compute the lowest frequencies [Hz] of plates with masses [kg] at states q.

        There is one state per film. ``parameters`` are as for :meth:`states`. The voltage is
        constant, and there is no air.
        """
        found = [_frequency(films, np.arange(len(films)), q[part], voltages[part] ** 2,
                            masses[part]) for part, films in self.blocks(parameters)]
        return np.concatenate(found)

    def frequency(self, parameters: Any, forces: Any, voltages: Any, masses: Any) -> AnyArray:
        """Compute the lowest frequency [Hz] of motion along the load, (films, states).

        ``masses`` of the plates [kg] are broadcast as forces and voltages. The voltage is constant,
        and there is no air. The frequency is nan where the family holds no state.
        """
        return self.states(parameters, forces, voltages, check=False, masses=masses).frequency

    def limits(self, parameters: Any, forces: Any) -> tuple[AnyArray, AnyArray]:
        """Find the voltages [V] of breakdown, and up to which films are taut and stable.

        Forces [N] are broadcast to (films, forces), the shape of both results. The second is the
        voltage of the first loss of tension or pull-in; :meth:`ends` distinguishes these. A voltage
        is infinite if the limit is not reached within the family's voltages. It is nan if there is
        no state at the lowest of these, or if a film loses tension or stability before it breaks
        down.
        """
        ends = self.ends(parameters, forces)
        return ends.breakdown, ends.taut

    def ends(self, parameters: Any, forces: Any, strengths: Any = 1.0) -> FilmEnds:
        """Find the voltages at which films break down, lose tension or pull in.

        Forces are as for :meth:`limits`. ``strengths``: factors on the films' electric strength,
        (films,) or one.
        """
        rows = np.atleast_2d(np.asarray(parameters, dtype=float))
        force = np.broadcast_to(np.asarray(forces, float), (len(rows), np.shape(forces)[-1]
                                                            if np.ndim(forces) else 1))
        strength = np.broadcast_to(np.asarray(strengths, float), len(rows))
        each = (np.repeat(rows, force.shape[1], axis=0), force.ravel(),
                np.repeat(strength, force.shape[1]))
        whole, first = (self.first_limits(*each, wanted=wanted)
                        for wanted in (ENDS, (*ENDS, BREAKDOWN.kind)))
        taut, none = whole.voltage, np.where(np.isnan(whole.voltage), np.nan, np.inf)
        slack = (whole.kind == TENSION.kind) & np.isfinite(taut)
        broken = (first.kind == BREAKDOWN.kind) & np.isfinite(first.voltage)
        breakdown = np.where(broken, first.voltage, np.where(np.isinf(taut), taut, np.nan))
        tension, pull_in = np.where(slack, taut, none), np.where(slack, np.nan, taut)
        return FilmEnds(breakdown=breakdown.reshape(force.shape),
                        tension=tension.reshape(force.shape),
                        pull_in=pull_in.reshape(force.shape))

    def first_limits(self, parameters: Any, forces: AnyArray, strengths: Any = 1.0, *,
                     wanted: Collection[str] = ()) -> FirstLimits:
        """Find first limits of films, (films, names), as the voltage rises.

        The forces [N] have the shape (films,). ``strengths``: factors on the films' electric
        strength, (films,) or one. ``wanted``: kinds to be searched; the default is all
        :func:`~tympan.studies.films.first_limits.kinds`.
        """
        strength = np.broadcast_to(np.asarray(strengths, float), forces.shape)
        found = [first_limits(partial(self.margins, RaisedFilms(
            films, films.at(self.looked_at), forces[part], strength[part], wanted or kinds())),
                              len(films), *self.squared)
                 for part, films in self.blocks(parameters)]
        return FirstLimits(np.concatenate([some.voltage for some in found]),
                           np.concatenate([some.kind for some in found]))

    @property
    def squared(self) -> tuple[float, float]:
        """Lowest and highest U² [V²]."""
        return self.voltage[0] ** 2, self.voltage[1] ** 2

    def margins(self, raised: RaisedFilms, number: AnyArray, squared: AnyArray,
                near: AnyArray | None) -> FilmMargins:
        """Compute the margins of some films, by their numbers, at U² of each, from states near."""
        films, at, wanted = raised.films, raised.at, raised.wanted
        force, strength = raised.forces[number], raised.strengths[number]
        if near is None:
            balance = self._rests(films, number, force, squared)
        else:
            balance = films.balanced(number, force, squared, near)
            some = np.flatnonzero(~balance.sound)
            if films.loading.softening and len(some):  # a plate that snaps has another equilibrium
                balance.put(some, self._rests(films, number[some], force[some], squared[some]))
        holds = balance.sound & self._loads_within(force, squared**0.5)
        holds &= self.box.holds(films.rows[number])
        q = np.where(holds[:, None], balance.q, np.nan)
        extremes = films.extremes(at, number, q, squared)
        least = np.where(holds, balance.least, np.nan)
        by_kind = {TENSION.kind: extremes.tension, PULL_IN.kind: least**2,
                   BREAKDOWN.kind: 1 - (extremes.share / strength) ** 2}
        asked = self.measured & set(wanted)
        by_kind = {kind: margin for kind, margin in by_kind.items() if kind in asked}
        by_kind |= {state.kind: films.least(state.field, at, number, q, squared)
                    for state in strained() if state.kind in asked}
        unasked = not set(WITHIN) & set(wanted)
        return FilmMargins(by_kind, extremes.sound | unasked, extremes.lawful, q)

    def _rests(self, films: Films, number: AnyArray, force: AnyArray, squared: AnyArray) -> Balance:
        """Solve for equilibria of films, by their numbers, under loads of each."""
        return films.first_rests(number, force, squared)

    def _placed(self, films: Films, number: AnyArray, points: AnyArray) -> AnyArray:
        """Find where points of the family's places are in the mounted films [m], (states, 2)."""
        corners = films.nodes[number[:, None], self.places.nodes[points]]
        return np.asarray(np.einsum("slc,sl->sc", corners, self.places.values[points]))

    def _slope(self, films: Films, number: AnyArray, q: AnyArray) -> AnyArray:
        """Compute the slopes of the plates along x and y [rad], (states, 2)."""
        return np.zeros((len(q), 2))

    def _shift(self, films: Films, q: AnyArray) -> AnyArray:
        """Compute the motions of the plates' centres along x and y [m], (states, 2)."""
        return np.zeros((len(q), 2))

    def _loads_within(self, force: AnyArray, voltage: AnyArray) -> Mask:
        return np.asarray((force >= self.force[0] - 1e-9) & (force <= self.force[1] + 1e-9)
                          & (np.abs(voltage) <= self.voltage[1] * (1 + 1e-9))
                          & (np.abs(voltage) >= self.voltage[0] * (1 - 1e-9)))

    def error(self, films: Films, number: AnyArray, q: AnyArray, force: AnyArray, squared: AnyArray,
              stiffness: AnyArray) -> AnyArray:
        """Estimate the errors of the deflections of states q of films [m], (states,)."""
        return np.zeros(len(q))

    def _error(self, films: Films, number: AnyArray, q: AnyArray, force: AnyArray,
               squared: AnyArray,
               stiffness: AnyArray, shape: tuple[int, ...]) -> AnyArray:
        """Estimate errors of deflections [m], (states,), at each film's largest deflection.

        States for which this error is a large share of the deflection get their own estimate.
        """
        there = np.abs(q[:, 0])
        deflection = np.where(np.isfinite(there), there, -1.0)
        most = deflection.reshape(shape).argmax(1) + shape[1] * np.arange(shape[0])

        def of(some: AnyArray) -> AnyArray:
            return self.error(films, number[some], q[some], force[some], squared[some],
                              stiffness[some])

        result = np.where(np.isfinite(there), np.repeat(of(most), shape[1]), np.nan)
        large = np.setdiff1d(np.flatnonzero(result > _LARGE * there), most)
        result[large] = of(large)
        return result


@dataclass(frozen=True, eq=False)
class ReducedFamily(FilmFamily):
    """Films made from a few finite-element films.

    ``factor``: scales the error estimate so that it covers the errors of random films on the
    family's mesh. The estimate is the ``check``'s plus ``usual``, a share of the deflection, since
    the check's estimate has a sign and may be zero by chance. ``remeshed``: largest relative
    difference of deflections on meshes of their own. ``restressed``: the same for their largest
    stresses. ``tilted``: largest error of their slopes [rad]. ``unstable``: number of random films
    that finite elements find unstable, though their reduced films are not. ``places``: nodes
    at which some film has nearly its largest strain or field.
    ``snapshots``: number of finite-element states that the family was made from.
    """

    reduction: Reduction
    guess: Guess
    check: ResidualCheck
    places: Sites
    factor: float = 1.0
    usual: float = 1e-7
    remeshed: float = 0.0
    restressed: float = 0.0
    tilted: float = 0.0
    unstable: int = 0
    snapshots: int = 0

    def films(self, rows: AnyArray) -> Films:
        """Build the films with given parameters, rows of (films, names)."""
        nodes = self.ground.nodes(rows)
        return replace(self._one, rows=rows, columns=self.box.columns(rows), nodes=nodes,
                       spring=self.box.springs(rows),
                       pressure=self.box.pressures(rows, self.ground.pressure),
                       tilting=self.ground.tilting(self.reduction, rows, nodes))

    @cached_property
    def _one(self) -> Films:
        """One of its films; the shapes at points are equal in all films."""
        return films_of(self.ground, self.reduction, self.box.low[None])

    @cached_property
    def looked_at(self) -> ShapesAt:
        """Shapes at the family's places."""
        return ShapesAt(self.places, self.reduction.every)

    @property
    def at_nodes(self) -> ShapesAt:
        """Shapes at the nodes of every element."""
        return ShapesAt(Sites.at_nodes(self.ground.model.discretisation), self.reduction.every)

    @property
    def whole(self) -> ShapesAt:
        """Shapes at all quadrature points."""
        return self._one.whole

    def _rests(self, films: Films, number: AnyArray, force: AnyArray, squared: AnyArray) -> Balance:
        """Solve for equilibria of films, by their numbers, under loads of each."""
        if films.loading.softening:
            return films.first_rests(number, force, squared)
        near: Balance = self.guess.balanced(films, self.box.scaled(films.rows), number, force,
                                            squared)
        return near

    def _slope(self, films: Films, number: AnyArray, q: AnyArray) -> AnyArray:
        """Compute the slopes of the plates along x and y [rad], (states, 2)."""
        about_x, about_y = np.clip(films.tilts(number, q).T, -1.0, 1.0)
        return self._free_of_planes(np.arcsin(np.stack([-about_y, about_x], axis=1)))

    def _shift(self, films: Films, q: AnyArray) -> AnyArray:
        """Compute the motions of the plates' centres along x and y [m], (states, 2)."""
        return self._free_of_planes(q @ films.shifts.T)

    def _free_of_planes(self, values: AnyArray) -> AnyArray:
        """Set values along x and y to 0 across the planes that mirror all films, (states, 2)."""
        free = [axis not in self.ground.model.discretisation.planes for axis in "xy"]
        return np.where(np.isfinite(values), values * free, values)

    def error(self, films: Films, number: AnyArray, q: AnyArray, force: AnyArray, squared: AnyArray,
              stiffness: AnyArray) -> AnyArray:
        """Estimate the errors of the deflections of states q of films [m], (states,)."""
        deflection = np.abs(q[:, 0])
        off = self.check.estimate(films, number, q, force, squared, stiffness)
        return self.factor * (off + self.usual * deflection) + self.remeshed * deflection


@dataclass(frozen=True, eq=False)
class FormulaFamily(FilmFamily):
    """Films in closed form: their ``formula`` on arrays, without error."""

    restressed: ClassVar[float] = 0.0
    tilted: ClassVar[float] = 0.0
    unstable: ClassVar[int] = 0
    formula: Formula

    def films(self, rows: AnyArray) -> Films:
        return FormulaFilms.of(self.formula, self.box, rows, self.ground.model.loading,
                               self.ground.pressure)

    @cached_property
    def looked_at(self) -> ShapesAt:
        return self.films(self.box.low[None]).whole

    @property
    def places(self) -> Sites:
        return self.looked_at.sites

    @property
    def at_nodes(self) -> ShapesAt:
        return self.looked_at

    @property
    def whole(self) -> ShapesAt:
        return self.looked_at

    @property
    def measured(self) -> frozenset[str]:
        every = super().measured
        return every if self.formula.stretches is not None else every & {PULL_IN.kind}


def _frequency(films: Films, number: AnyArray, q: AnyArray, squared: AnyArray, mass: AnyArray
               ) -> AnyArray:
    """Compute the lowest frequencies [Hz] of plates with a mass in states q; nan without."""
    result = np.full(len(q), np.nan)
    some = np.flatnonzero(np.isfinite(q).all(1) & np.isfinite(mass))
    if len(some):
        _, stiffness = films.pull(number[some], q[some], squared[some])
        firm = positive_definite(stiffness)  # near a pull-in some may not be
        some, stiffness = some[firm], stiffness[firm]
        inertia = films.inertia[number[some]]
        inertia[:, 0, 0] += mass[some]
        # The largest 1/w² of K v = w² M v, as the eigenvalue of a symmetric matrix.
        root = np.linalg.inv(np.linalg.cholesky(stiffness))
        slow = np.linalg.eigvalsh(root @ inertia @ root.swapaxes(-1, -2))[:, -1]
        result[some] = 1 / (2 * np.pi * np.sqrt(slow))
    return result


def films_of(ground: Ground, reduction: Reduction, rows: AnyArray) -> Films:
    """Build the films with given parameters."""
    whole, shapes = Sites.quadrature(ground.model.discretisation), reduction.every
    freedoms = np.array([plate_freedoms(ground.model, shape, reduction.arms)
                         for shape in reduction.shapes]).T
    few = whole.some(reduction.points, reduction.shares)
    box, nodes = ground.box, ground.nodes(rows)
    return Films(specimen=box.specimen, rows=rows, columns=box.columns(rows),
                 nodes=nodes, points=ShapesAt(few, shapes),
                 whole=ShapesAt(whole, shapes), loading=ground.model.loading,
                 spring=box.springs(rows), pressure=box.pressures(rows, ground.pressure),
                 gap=np.array([box.specimen.gap]), turns=freedoms[TURNS],
                 tilting=ground.tilting(reduction, rows, nodes), shifts=freedoms[:2])


@dataclass(frozen=True, eq=False)
class Guess:
    """Amplitudes as a quadratic function of parameters and loads, fitted to solved states.

    ``weights`` (terms, shapes). ``spread``: largest error at these states, (shapes,).
    """

    force: tuple[float, float]
    squared: tuple[float, float]
    weights: AnyArray
    spread: AnyArray

    @classmethod
    def of(cls, force: tuple[float, float], squared: tuple[float, float], scaled: AnyArray,
           forces: AnyArray, squares: AnyArray, q: AnyArray) -> Guess:
        """Fit to states q, (states, shapes), of films with scaled parameters (states, names)."""
        made = cls(force, squared, np.zeros((1, q.shape[1])), np.zeros(q.shape[1]))
        terms = made._terms(scaled, forces, squares)
        gram = terms.T @ terms
        ridge = _RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram))
        weights = np.linalg.solve(gram + ridge, terms.T @ q)
        return replace(made, weights=weights, spread=np.abs(q - terms @ weights).max(0))

    def _terms(self, scaled: AnyArray, force: AnyArray, squared: AnyArray) -> AnyArray:
        loads = [2 * (value - low) / max(high - low, 1e-30) - 1 for value, (low, high) in
                 ((force, self.force), (squared, self.squared))]
        z = np.column_stack([scaled, *loads])
        first, second = np.triu_indices(z.shape[1])
        cubes = [loads[1] ** 3, loads[1] ** 2 * loads[0]]
        return np.column_stack([np.ones(len(z)), z, z[:, first] * z[:, second], *cubes])

    def balanced(self, films: Films, scaled: AnyArray, number: AnyArray, force: AnyArray,
                 squared: AnyArray
                 ) -> Any:
        """Solve from the guess; if that fails or leads far away, increase the loads in steps."""
        guess = self._terms(scaled[number], force, squared) @ self.weights
        balance = films.balanced(number, force, squared, guess)
        far = np.abs(balance.q - guess).max(1) > _FAR * np.maximum(
            np.abs(guess).max(1), 10 * self.spread.max())
        again = np.flatnonzero(~balance.sound | far)
        if len(again):
            slow = films.carried(number[again], force[again], squared[again],
                                 np.zeros((len(again), films.count)), 2 * _STEPS)
            balance.put(again, slow)
        return balance


#: Regularisation of the least squares, relative to the mean square of the terms.
_RIDGE = 1e-9
#: Largest distance of a state from its guess, over the guess; beyond it the loads are increased in
#: steps.
_FAR = 0.3


@dataclass(frozen=True, eq=False)
class _Making:
    """A family while it is made."""

    ground: Ground
    force: tuple[float, float]
    voltage: tuple[float, float]
    settings: FamilySettings

    @property
    def squared(self) -> tuple[float, float]:
        """Lowest and highest U² [V²]."""
        return self.voltage[0] ** 2, self.voltage[1] ** 2

    def drawn(self, count: int, seed: int) -> tuple[AnyArray, AnyArray, AnyArray]:
        """Draw parameters (count, names), forces and U² of random films.

        They are uniformly distributed over the box.
        """
        box = self.ground.box
        shares = drawn_points(len(box.names) + 2, count, seed)
        force, squared = (low + share * (high - low) for share, (low, high) in
                          zip(shares[:, -2:].T, (self.force, self.squared), strict=True))
        return box.between(shares[:, :-2]), force, squared

    def made(self) -> ReducedFamily:
        """Make the family."""
        settings = self.settings
        count = settings.first + settings.more * len(self.ground.box.names)
        shots = self._first(*self.drawn(count, settings.seed))
        rows, forces, squares = self.drawn(settings.candidates, settings.seed + 1)
        family, balance = self._family(shots, rows, forces, squares)
        last = np.inf
        for _ in range(settings.rounds):
            held = np.flatnonzero(balance.sound)
            worst, estimates = self._worst(family, rows[held], forces[held], squares[held])
            if not len(worst) or estimates[0] <= settings.error:
                break
            if len(family.reduction.shapes) == _MOST and estimates[0] > _GAINED * last:
                break
            last = estimates[0]
            more = [shot for number in held[worst] if (shot := self._refined(
                family, rows[number], forces[number], squares[number])) is not None]
            if not more:
                break
            shots = [*shots, *more]
            family, balance = self._family(shots, rows, forces, squares, (family, balance))
        return self._scaled(family)

    def _first(self, rows: AnyArray, forces: AnyArray, squares: AnyArray) -> list[Snapshot]:
        for partly in (False, True):  # far beyond most films' ends few have a state
            solved = [self.ground.solved(row, force, squared, partly=partly) for row, force, squared
                      in zip(rows, forces.tolist(), squares.tolist(), strict=True)]
            shots = [self._shot(row, *pair) for row, pair in zip(rows, solved, strict=True)
                     if pair is not None]
            if len(shots) >= 2:
                return shots
        raise self._empty()

    def _empty(self) -> InputError:
        return InputError("hardly any film like it has an equilibrium in tension under these "
                          "loads: take lower ones", key=self.ground.box.specimen.name)

    def _shot(self, row: AnyArray, model: Model, solution: Solution) -> Snapshot:
        state, rates, box = solution.state, [], self.ground.box
        ranges: dict[Load, tuple[float, float]] = {"force": self.force, "voltage": self.squared}
        if PRESSURE in box.names:
            at = box.names.index(PRESSURE)
            ranges["pressure"] = float(box.low[at]), float(box.high[at])
        for load, (low, high) in ranges.items():
            wide = (high - low) or max(abs(high), abs(low))
            if wide:
                rate = solution.rate(model, load)
                rates.append(moved(model, state, rate, _RATE * wide).positions - state.positions)
        rates += [moved(model, state, motion).positions - state.positions
                  for motion in self._responses(row, model, solution)]
        return Snapshot(model, state, rates=tuple(rates))

    def _responses(self, row: AnyArray, model: Model, solution: Solution) -> Iterator[Parts]:
        """Yield motions of film and plate by voltages of segments, and by moments on the plate.

        With its response to a moment among the shapes, the error of a tilt is of second order in
        what the shapes leave out, as that of the deflection is by its response to a force.
        """
        state, box, tangent = solution.state, self.ground.box, solution.tangent
        assert tangent is not None
        balance = model.residual(model.nodal_forces(state), state)
        at = box.shares(row[None])
        for name in box.segments:
            there = at.copy()
            there[:, box.names.index(name)] += _RATE if there[0, box.names.index(name)] < 0.5 \
                else -_RATE
            other = self.ground.film(box.between(there)[0])
            unbalanced = other.residual(other.nodal_forces(state), state)
            film, plate = tangent.respond((unbalanced[0] - balance[0], unbalanced[1] - balance[1]))
            yield -film, -plate
        for number, freedom in enumerate(model.plate_freedoms):
            if FREEDOMS[freedom] in ("rx", "ry"):
                moment = np.eye(len(model.plate_freedoms))[number]
                film, plate = tangent.respond((np.zeros_like(balance[0]), moment))
                scale = _TURN * abs(model.deflection(state)) / (abs(plate[number]) * model.size)
                yield scale * film, scale * plate

    def _refined(self, family: ReducedFamily, row: AnyArray, force: float, squared: float
                 ) -> Snapshot | None:
        states = family.states(row, force, squared**0.5, check=False)
        found = None
        if states.holds.all():
            found = self._found(family, states.q[0, 0], row, force, squared)
        return None if found is None else self._shot(row, *found)

    def _family(self, shots: Sequence[Snapshot], rows: AnyArray, forces: AnyArray,
                squares: AnyArray, before: tuple[ReducedFamily, Balance] | None = None
                ) -> tuple[ReducedFamily, Balance]:
        """Make a family of snapshots; return also the states of films with given parameters.

        ``before``: the same of fewer snapshots; what had no state then is not sought again.
        """
        motion = _MOTION * (self.settings.error / FamilySettings.error) ** 0.5
        reduction = Reduction.of(shots, motion, _WORK, _MOST, _SOFTENING, turning=True)
        films = films_of(self.ground, reduction, rows)
        number, flat = np.arange(len(rows)), np.zeros((len(rows), films.count))
        if films.loading.softening:
            balance = films.first_rests(number, forces, squares)
        elif before is None:
            balance = films.carried(number, forces, squares, flat, _STEPS)
        else:
            family, known = before
            near = known.q @ reduction.along(family.reduction)
            balance = films.balanced(number, forces, squares, near)
            again = np.flatnonzero(known.sound & ~balance.sound)
            balance.sound[~known.sound] = False
            balance.put(again, films.carried(again, forces[again], squares[again], flat[again],
                                             _STEPS))
        some = np.flatnonzero(balance.sound)
        if not len(some):
            raise self._empty()
        guess = Guess.of(self.force, self.squared, self.ground.box.scaled(rows[some]),
                         forces[some], squares[some], balance.q[some])
        check = ResidualCheck.of(shots[0], reduction)
        made = ReducedFamily(self.ground, self.force, self.voltage, reduction, guess, check,
                             self._places(films, some, balance.q[some], squares[some]),
                             snapshots=len(shots))
        return made, balance

    def _places(self, films: Films, number: AnyArray, q: AnyArray, squared: AnyArray) -> Sites:
        """Find element nodes at which some film has nearly its largest strain or field."""
        sites = Sites.at_nodes(self.ground.model.discretisation)
        at = films.at(ShapesAt(sites, films.whole.shapes))
        near = np.zeros(len(sites.cells), dtype=bool)
        # Fields jump at the edges of segments: each segment has its own range.
        segments = [np.flatnonzero(sites.segments == own) for own in np.unique(sites.segments)]
        for part in films.parts(number, len(near)):
            here = films.local(at, number[part], q[part], squared[part])
            for values in (here.stretch_1, here.stress_1, -here.stress_2, here.electric_field,
                           here.breakdown_share):
                for own in segments:
                    of = values[:, own]
                    most, least = of.max(1, keepdims=True), of.min(1, keepdims=True)
                    wide = most > least
                    near[own] |= (wide & (of >= most - _NEARLY * (most - least))).any(0)
                    near[own[0]] |= not wide.all()  # an even field, such as none, is so everywhere
        return sites.some(np.flatnonzero(near), np.zeros(int(near.sum())))

    def _worst(self, family: ReducedFamily, rows: AnyArray, forces: AnyArray, squares: AnyArray
               ) -> tuple[AnyArray, AnyArray]:
        """Find the films with the largest estimates, and these over the deflection."""
        states = family.states(rows, forces[:, None], squares[:, None] ** 0.5)
        share = np.nan_to_num(_relative(states))
        order = np.argsort(share)[::-1][: self.settings.batch]
        return order, share[order]

    def _scaled(self, family: ReducedFamily) -> ReducedFamily:
        """Scale the family's estimate so that it covers the errors of random films."""
        rows, forces, squares = self.drawn(self.settings.checks, self.settings.seed + 2)
        states = family.states(rows, forces[:, None], squares[:, None] ** 0.5)
        usual = float(np.nanmean(_relative(states)))
        error = states.error + (usual - family.usual) * np.abs(states.deflection)
        family = replace(family, usual=usual)
        ratios, solved, stresses, tilts = [], list[tuple[int, float]](), [0.0], [0.0]
        unstable = 0
        for number in np.flatnonzero(states.holds[:, 0]).tolist():
            found = self._found(family, states.q[number, 0], rows[number], forces[number],
                                squares[number])
            unstable += found is None and states.tension[number, 0] > _TENSE * states.stress[
                number, 0]
            if found is not None:
                deflection, stress = _moved(*found)
                slope = np.array(found[1].state.plate.slope)
                tilts.append(float(np.abs(slope - states.slope[number, 0]).max()))
                solved.append((number, deflection))
                ratios.append(abs(deflection - states.deflection[number, 0]) / error[number, 0])
                stresses.append(abs(stress / states.stress[number, 0] - 1))
        remeshed = [0.0]
        for number, deflection in self._outermost(rows, solved):
            apart, stress = self._remeshed(rows[number], forces[number], squares[number])
            remeshed.append(abs(apart - deflection) / abs(deflection))
            stresses.append(abs(stress / states.stress[number, 0] - 1))
        return replace(family, factor=_MARGIN * max([1.0, *ratios]), remeshed=max(remeshed),
                       restressed=_STRESS_MARGIN * max(stresses), tilted=_MARGIN * max(tilts),
                       unstable=int(unstable))

    def _found(self, family: ReducedFamily, q: AnyArray, row: AnyArray, force: float, squared: float
               ) -> tuple[Model, Solution] | None:
        """Solve the finite-element film near a state of the family."""
        along = family.films(row[None]).along(_ALONE, q[None])[0]
        motion = np.tensordot(along, family.reduction.every, 1)
        return self.ground.solved(row, force, squared, motion)

    def _outermost(self, rows: AnyArray, solved: list[tuple[int, float]]) -> list[tuple[int,
                   float]]:
        """Select those of some films whose lengths are farthest from the box's middle."""
        box = self.ground.box
        lengths = [box.names.index(name) for name in box.lengths]
        far = np.linalg.norm(box.scaled(rows)[:, lengths], axis=1)
        return sorted(solved, key=lambda pair: -far[pair[0]])[: _REMESHED if lengths else 0]

    def _remeshed(self, row: AnyArray, force: float, squared: float) -> tuple[float, float]:
        """Compute deflection [m] and largest stress [Pa] of a film on its own mesh."""
        ground = self.ground
        fresh = ground.fresh(row)
        return _moved(fresh, equilibrium(fresh, force, squared**0.5, ground.gas(row),
                                         settings=ground.path))


def _relative(states: FilmStates) -> AnyArray:
    """Divide errors of one state of each film by its deflection, (films,).

    The deflection counts as at least a part of the largest one.
    """
    deflection = np.abs(states.deflection[:, 0])
    largest = float(np.nanmax(deflection, initial=0.0))
    with np.errstate(invalid="ignore"):
        return np.asarray(states.error[:, 0] / np.maximum(deflection, _LEVEL * largest))


def _moved(model: Model, solved: Solution | Outcome) -> tuple[float, float]:
    """Compute deflection [m] and largest stress [Pa] of a finite-element film."""
    there, = node_fields(model, [solved.state])
    return model.deflection(solved.state), float(there.stress_1.max())
