"""Solve a view into a scene: on the mesh at hand, and from the last equilibrium where possible."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.explore.view import FilmView
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE
from tympan.fem.rig import DIRECTIONS, Rig
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.alpha import AlphaResult, AlphaSettings, alpha
from tympan.studies.case import (
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
from tympan.studies.force import blocked_force
from tympan.studies.limits import CurveResult, curve

Array = NDArray[Any]

#: Every element of a film is drawn as so many triangles, squared.
_PARTS = 3


@dataclass(frozen=True, eq=False)
class Blocked:
    """Force of a view's plate if it is blocked where it rests without voltage [N]; None of none.

    ``off``: by how much it may be wrong [N].
    """

    view: FilmView
    force: float | None
    off: float = 0.0


@dataclass(frozen=True, eq=False)
class Scene:
    """The numbers of a view and its film.

    ``film`` is None where there is no equilibrium: ``result.warnings`` say why.
    """

    view: FilmView
    result: CaseResult
    film: FilmSurface | None = None


class Session:
    """Solves views; a mesh serves as long as the next film needs the same.

    An equilibrium is the start of the next one where only mass or voltage differ. Where that does
    not lead to one, the film is loaded anew, as ``tympan solve`` does.
    """

    def __init__(self, settings: Settings = Settings()) -> None:
        self.settings = settings
        self._needs: object = None
        self._model: Model | None = None
        self._start: tuple[Specimen, Rig, Solution] | None = None
        self._rest: tuple[FilmView, Solution] | None = None

    def scene(self, view: FilmView) -> Scene:
        """The film of a view.

        Raises
        ------
        InputError
            When it cannot be meshed.
        """
        case = view.case
        model = self._meshed(case)
        outcome = self._equilibrium(model, case)
        (result, _), = summaries(model, [(case, outcome)], 0.0)
        if outcome.status != "equilibrium":
            return Scene(view, result)
        return Scene(view, result, film_surface(model, outcome.state, _PARTS))

    def blocked(self, view: FilmView) -> Blocked:
        """Blocked force of the plate of a view."""
        model, rest = self._meshed(view.case), replace(view, voltage=0.0)
        if HEAVE not in model.plate_freedoms:
            return Blocked(view, None)
        if self._rest is None or self._rest[0] != rest:
            start = self._start
            if model.loading.softening:
                self._start = None  # from there it may come to rest elsewhere
            outcome = self._equilibrium(model, rest.case)
            self._start = start
            if outcome.status != "equilibrium":
                return Blocked(view, None)
            self._rest = rest, outcome.solution
        return Blocked(view, blocked_force(model, self._rest[1], view.case.film_voltage,
                                           self.settings.path))

    def _meshed(self, case: Case) -> Model:
        specimen, loading = case.specimen, case.rig.loading
        needs = loading, needs_mesh(specimen, self.settings, loading)
        if self._model is None or needs != self._needs:
            self._model, self._needs = None, None  # not half of it where meshing fails
            _forget_films()
            self._model = build_model(specimen, self.settings, loading)
            self._needs = needs
        if self._model.specimen != specimen:
            self._model = replace(self._model, specimen=specimen)
        return self._model

    def _equilibrium(self, model: Model, case: Case) -> Outcome:
        loads = (case.force(model.plate_area), case.film_voltage, case.rig.gas_pressure)
        outcome = None
        if self._start is not None and self._start[:2] == (case.specimen, case.rig):
            outcome = equilibrium(model, *loads, self._start[2], self.settings.path)
        if outcome is None or outcome.status != "equilibrium":
            outcome = equilibrium(model, *loads, settings=self.settings.path)
        self._start = ((case.specimen, case.rig, outcome.solution)
                       if outcome.status == "equilibrium" else None)
        return outcome


def _forget_films() -> None:
    """Give memory back: outlines hardly come again, and films of all sizes leave it in pieces."""
    meshed.cache_clear()
    with suppress(OSError, AttributeError):  # of C libraries that have no such function
        ctypes.CDLL(None).malloc_trim(0)


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings on a specimen under a mass, in SI, and what the simulation reads there.

    ``simulated`` is NaN where the film has no equilibrium.
    """

    voltage: Array
    measured: Array
    simulated: Array

    @property
    def residual(self) -> Array:
        """Measured minus simulated [m]."""
        return np.asarray(self.measured - self.simulated)

    @property
    def rms(self) -> float:
        """Root mean square of the residuals that there are [m], NaN of none."""
        residual = self.residual[np.isfinite(self.residual)]
        return float(np.sqrt((residual**2).mean())) if len(residual) else np.nan


@dataclass(frozen=True)
class Question:
    """Question for a curve: its view, whose voltage is nothing to it, and readings to meet."""

    view: FilmView
    static: Sheet | None = None


@dataclass(frozen=True)
class Off:
    """Largest error of a reduced film against finite elements.

    ``deflection`` at the view's voltage [m]; ``whole``: it was followed to its pull-in. Otherwise
    limits that are not met are not known.
    """

    deflection: float
    whole: bool


@dataclass(frozen=True, eq=False)
class FollowedCurve:
    """The curve of a view, the readings under its mass, if any, and α of its film.

    ``circles`` is a text where there are none, and None where they are still sought; ``off``: of a
    reduced film.
    """

    view: FilmView
    curve: CurveResult
    readings: Readings | None = None
    circles: AlphaResult | str | None = None
    off: Off | None = None


def followed(question: Question, settings: Settings = Settings()) -> Iterator[FollowedCurve]:
    """The curve to the film's limits, with readings; then also the circles that stand for it."""
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


def compared(view: FilmView, static: Sheet, settings: Settings, highest: float) -> Readings | None:
    """Readings of a view's specimen under its mass, beside the simulation's; None if none."""
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
