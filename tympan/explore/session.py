"""Solution of a view: on the present mesh, and from the last equilibrium where possible."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.paths import at
from tympan.explore.view import FilmView
from tympan.fem.derivatives.shape import motion_between, moved_by
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.solve import equilibrium, equilibrium_near
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE
from tympan.fem.results.fields import Unfolding
from tympan.fem.rig import DIRECTIONS, Rig
from tympan.geometry.specimen import Specimen
from tympan.reports.figures.curve import VoltageCurve, voltage_curves
from tympan.studies.alpha import AlphaResult, AlphaSettings, alpha
from tympan.studies.case import (
    Band,
    Case,
    CaseResult,
    Settings,
    build_model,
    meshed,
    needs_mesh,
    summaries,
)
from tympan.studies.columns import Sheet
from tympan.studies.film_surface import FilmSurface, film_surface
from tympan.studies.films.box import kind_of, varying
from tympan.studies.force import blocked_force
from tympan.studies.limits.curve import CurveResult, curve
from tympan.studies.tolerance.bands import banded
from tympan.studies.tolerance.given import Tolerances, of_library

#: Largest relative change of numbers for which a mesh moves with them; of the gap for offsets.
_LITTLE = 0.5

#: Fineness of meshes while numbers slide, over that of ``tympan solve``: of 24 random films
#: deflections were within 4e-4 and fields within 1e-2, in half of the time.
_COARSE = 0.6

#: Largest distance of an equilibrium from another film's, relative to its motion, while numbers
#: change. A second equilibrium of one film is farther away.
_ALIKE = 0.5

#: Square root of the number of triangles drawn for every element of a film.
_PARTS = 3


@dataclass(frozen=True, eq=False)
class Blocked:
    """Force of a view's plate blocked at its equilibrium without voltage [N]; None without one.

    ``off`` is its possible error [N].
    """

    view: FilmView
    force: float | None
    off: float = 0.0


@dataclass(frozen=True, eq=False)
class Scene:
    """The numbers of a view and its film.

    ``draw`` computes the ``film``, and is None where there is no equilibrium: ``result.warnings``
    say why. ``guessed``: it is on a coarse mesh, or was found from another film, possibly on that
    film's mesh, moved. On its own mesh the deflection differs by some 1e-4, the largest field by up
    to 1e-2.
    """

    view: FilmView
    result: CaseResult
    draw: Callable[[], FilmSurface | None] | None = None
    guessed: bool = False

    @cached_property
    def film(self) -> FilmSurface | None:
        """Surface of the film; drawing takes longer than its numbers."""
        return None if self.draw is None else self.draw()


class Views:
    """Solver of views: on coarse meshes while numbers slide, on their own once they rest."""

    def __init__(self, settings: Settings = Settings()) -> None:
        self._own = Session(settings)
        self._coarse = Session(replace(settings, mesh=settings.mesh.refined(_COARSE)))

    def scene(self, view: FilmView, sliding: bool = False) -> Scene:
        """Solve the film of a view.

        Raises
        ------
        InputError
            When it cannot be meshed.
        """
        session = self._session(view, sliding)
        scene = session.scene(view, sliding)
        return replace(scene, guessed=scene.guessed or session is self._coarse)

    def blocked(self, view: FilmView, sliding: bool = False) -> Blocked:
        """Solve the blocked force of the plate of a view."""
        return self._session(view, sliding).blocked(view, sliding)

    def _session(self, view: FilmView, sliding: bool) -> Session:
        """Choose the solver; a film that is already on its own mesh stays there."""
        return self._coarse if sliding and not self._own.has(view) else self._own


class Session:
    """Solver of views; it keeps a mesh as long as the next film needs the same.

    An equilibrium is the start of the next one if only mass or voltage differ, and, while numbers
    slide, the basis of a guess if other numbers do. If that fails, the film is loaded anew, as by
    ``tympan solve``.
    """

    def __init__(self, settings: Settings = Settings()) -> None:
        self.settings = settings
        self._needs: object = None
        #: The model as it was meshed.
        self._model: Model | None = None
        self._unfolding: Unfolding | None = None
        self._start: tuple[Model, Rig, Solution] | None = None
        #: True if that start is a guess, or on a moved mesh.
        self._guessed = False
        self._rest: tuple[FilmView, Model, Solution] | None = None

    def has(self, view: FilmView) -> bool:
        """Whether the last equilibrium was that of the same film, on its own mesh."""
        return (not self._guessed and self._start is not None and self._start[1] == view.rig
                and self._start[0].specimen == view.actuator)

    def scene(self, view: FilmView, sliding: bool = False) -> Scene:
        """Solve the film of a view; while controls are ``sliding`` on the present mesh, moved.

        Raises
        ------
        InputError
            When it cannot be meshed.
        """
        case = view.case
        model = self._modelled(case, sliding)
        outcome = self._equilibrium(model, case, sliding)
        (result, _), = summaries(model, [(case, outcome)], 0.0)
        draw = None
        if outcome.status == "equilibrium":
            draw = partial(film_surface, model, outcome.state, _PARTS, self._unfolding)
        return Scene(view, result, draw, self._guessed)

    def blocked(self, view: FilmView, sliding: bool = False) -> Blocked:
        """Solve the blocked force of the plate of a view; ``sliding`` as for :meth:`scene`."""
        model, rest = self._modelled(view.case, sliding), replace(view, voltage=0.0)
        if HEAVE not in model.plate_freedoms:
            return Blocked(view, None)
        if self._rest is None or (self._rest[0], self._rest[1].discretisation) != (
                rest, model.discretisation):
            start, guessed = self._start, self._guessed
            if model.loading.softening:
                self._start = None  # the plate may come to rest elsewhere from there
            outcome = self._equilibrium(model, rest.case, sliding)
            self._start, self._guessed = start, guessed
            if outcome.status != "equilibrium":
                return Blocked(view, None)
            self._rest = rest, model, outcome.solution
        return Blocked(view, blocked_force(model, self._rest[2], view.case.film_voltage,
                                           self.settings.path))

    def _modelled(self, case: Case, sliding: bool) -> Model:
        """Make the model of a case, on its own mesh or, while numbers slide, the present one."""
        if sliding and self._start is not None and self._start[1] == case.rig and (
                self._start[0].specimen == case.specimen):
            return self._start[0]
        moved = self._moved(case) if sliding else None
        return self._meshed(case) if moved is None else moved

    def _meshed(self, case: Case) -> Model:
        specimen, loading = case.specimen, case.rig.loading
        needs = loading, needs_mesh(specimen, self.settings, loading)
        if self._model is None or needs != self._needs:
            self._model, self._needs = None, None  # so that no part remains if meshing fails
            _forget_films()
            self._model = build_model(specimen, self.settings, loading)
            self._unfolding = Unfolding.of(self._model.discretisation)
            self._needs = needs
        return self._model if self._model.specimen == specimen else replace(
            self._model, specimen=specimen)

    def _moved(self, case: Case) -> Model | None:
        """Move the present mesh to the lengths of a case; None if they differ too much."""
        model, specimen, loading = self._model, case.specimen, case.rig.loading
        if model is None or not _is_alike(specimen, model.specimen):
            return None
        other = model.specimen
        there = replace(specimen, frame=other.frame, plate=other.plate, electrode=other.electrode,
                        membrane=replace(specimen.membrane, prestretch=other.membrane.prestretch))
        if (loading, needs_mesh(there, self.settings, loading)) != self._needs:
            return None
        try:
            motion = motion_between(model.discretisation, other, specimen)
        except InputError:
            return None
        if not motion.any():
            return replace(model, specimen=specimen)
        return replace(model, discretisation=model.discretisation.moved(motion), specimen=specimen)

    def _equilibrium(self, model: Model, case: Case, sliding: bool = False) -> Outcome:
        loads = (case.force(model.plate_area), case.film_voltage, case.rig.gas_pressure)
        outcome = None
        if self._start is not None and self._start[1] == case.rig and (
                sliding or not self._guessed):
            before, _, solution = self._start
            if (before.specimen, before.discretisation) == (model.specimen, model.discretisation):
                outcome = equilibrium(model, *loads, solution, self.settings.path)
            elif sliding:
                outcome = self._near(model, before, solution, *loads)
                self._guessed = outcome is not None
        if outcome is None or outcome.status != "equilibrium":
            outcome = equilibrium(model, *loads, settings=self.settings.path)
            self._guessed = not self._is_own(model)
        self._start = ((model, case.rig, outcome.solution)
                       if outcome.status == "equilibrium" else None)
        return outcome

    def _near(self, model: Model, before: Model, solution: Solution, force: float, voltage: float,
              pressure: float) -> Outcome | None:
        """Find the equilibrium near that of another film; None if the two differ too much."""
        mesh, settings = model.discretisation, self.settings.path.bounded(model)
        if before.discretisation.unknowns is not mesh.unknowns or model.loading.softening:
            return None
        motion = (mesh.reference - before.discretisation.reference)[:, :2]
        _, guess = moved_by(before, solution.state, model.specimen, motion)
        loaded = guess.under(force=force, voltage=voltage**2, pressure=pressure)
        near = equilibrium_near(model, loaded, settings, _ALIKE)
        return None if near is None else Outcome("equilibrium", near)

    def _is_own(self, model: Model) -> bool:
        """Check whether a model is on a mesh of its own."""
        return self._model is not None and model.discretisation is self._model.discretisation


def _is_alike(specimen: Specimen, other: Specimen) -> bool:
    """Check whether specimens differ only in numbers, and in these by little."""
    if kind_of(specimen) != kind_of(other) or specimen.mirror_planes != other.mirror_planes:
        return False
    names = varying(other)
    here, there = (np.array([at(one, name.split(".")) for name in names], dtype=float)
                   for one in (specimen, other))
    offset = np.array([name.startswith("plate.offset") for name in names])
    scale = np.where(offset, other.gap, np.abs(there))
    return bool((np.abs(here - there) <= _LITTLE * scale).all())


def _forget_films() -> None:
    """Free memory: outlines rarely come again, and films of all sizes fragment it."""
    meshed.cache_clear()
    with suppress(OSError, AttributeError):  # other C libraries lack this function
        ctypes.CDLL(None).malloc_trim(0)


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings on a specimen under a mass, in SI, with the simulated readings.

    ``simulated`` is NaN where the film has no equilibrium.
    """

    voltage: Array
    measured: Array
    simulated: Array

    @property
    def residual(self) -> Array:
        """Measured minus simulated [m]."""
        return self.measured - self.simulated

    @property
    def rms(self) -> float:
        """Root mean square of the residuals that exist [m], NaN without any."""
        residual = self.residual[np.isfinite(self.residual)]
        return float(np.sqrt((residual**2).mean())) if len(residual) else np.nan


@dataclass(frozen=True)
class Question:
    """Question for a curve: its view, whose voltage is ignored, and readings to compare.

    With ``tolerances`` the curve is repeated at last, with the band of films that scatter.
    """

    view: FilmView
    static: Sheet | None = None
    tolerances: Tolerances | None = None


@dataclass(frozen=True)
class LargestError:
    """Largest error of a reduced film against finite elements.

    ``deflection`` is that at the view's voltage [m]. ``whole``: the film was followed to its
    pull-in; otherwise limits that are not found are unknown.
    """

    deflection: float
    whole: bool


@dataclass(frozen=True, eq=False)
class Bands:
    """Bands of films made to tolerances about a view, under its mass.

    Deflections [m] have bands at some ``voltages`` [V], and ``numbers`` of the view by the keys of
    a result.
    """

    view: FilmView
    voltages: tuple[float, ...]
    deflections: tuple[Band | None, ...]
    numbers: Mapping[str, Band] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class FollowedCurve:
    """The curve of a view, the readings under its mass, if any, and α of its film.

    ``circles`` is a text if there are none, and None while they are computed; ``off`` is the error
    of a reduced film.
    """

    view: FilmView
    curve: CurveResult
    readings: Readings | None = None
    circles: AlphaResult | str | None = None
    off: LargestError | None = None

    @cached_property
    def line(self) -> VoltageCurve:
        """Curve as it is drawn."""
        line, = voltage_curves(self.curve)
        return line

    def banded(self, bands: Bands) -> FollowedCurve:
        """Add bands of films that scatter about the curve."""
        curve, = self.curve.curves
        curve = replace(curve, band_voltage_V=bands.voltages, band_deflection_m=bands.deflections)
        return replace(self, curve=replace(self.curve, curves=(curve,)))


def followed(question: Question, settings: Settings = Settings()
             ) -> Iterator[FollowedCurve | Bands]:
    """Follow the curve to the film's limits, with readings; then find its circles; then bands."""
    _forget_films()
    view = question.view
    specimen = view.actuator
    along = curve(specimen, [view.mass], settings, view.rig)
    readings = None
    if question.static is not None:
        end = along.curves[0].limits.end
        readings = compared(view, question.static, settings,
                            np.inf if end is None else end.voltage_V)
    line = FollowedCurve(view, along, readings)
    yield line
    try:
        yield replace(line, circles=alpha(specimen, settings, AlphaSettings(), view.rig))
    except InputError as error:
        yield replace(line, circles=error.allowed)
    if question.tolerances is not None:
        scatter = of_library(question.tolerances, view.specimen)
        with suppress(InputError):  # hardly any film like it has an equilibrium
            scattered = banded(along, specimen, scatter, view.rig, settings).curves[0]
            yield Bands(view, scattered.band_voltage_V, scattered.band_deflection_m)


def compared(view: FilmView, static: Sheet, settings: Settings, highest: float) -> Readings | None:
    """Compare readings of a view's specimen under its mass with the simulation; None if none."""
    rows = np.flatnonzero((static.specimen == view.specimen.name)
                          & np.isclose(static.mass, view.mass, rtol=1e-6))
    if not len(rows):
        return None
    rows = rows[np.argsort(static.voltage[rows], kind="stable")]
    model = build_model(view.actuator, settings, view.rig.loading)
    simulated = np.full(len(rows), np.nan)
    solved: dict[tuple[float, float], Outcome] = {}
    start = None
    for number, row in enumerate(rows):
        case = replace(view.case, voltage=float(static.voltage[row]),
                       direction=DIRECTIONS[str(static.direction[row])],
                       elapsed=float(np.nan_to_num(static.elapsed[row])))
        if case.voltage > highest:
            continue
        key = case.voltage, case.direction
        if key not in solved:
            solved[key] = equilibrium(model, case.force(model.plate_area), case.film_voltage,
                                      case.rig.gas_pressure, start, settings.path)
        outcome = solved[key]
        if outcome.status == "equilibrium":
            start = outcome.solution
            simulated[number] = case.rig.reading(outcome.state.plate.deflection, case.elapsed)
    return Readings(static.voltage[rows], static.displacement[rows], simulated)
