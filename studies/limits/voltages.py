"""Voltages at which a film reaches each limit state, found in one pass."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.fields import Key
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.ramp import Outcome, Status
from tympan.fem.film.admissibility import beyond_range
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.limit_states import (
    INSTABILITY,
    LIMIT_STATES,
    PULL_IN,
    SNAP_BACK,
    SNAP_THROUGH,
    TENSION,
    begun,
)
from tympan.studies.case import (
    Case,
    CaseResult,
    Limit,
    Limits,
    Settings,
    SpecimenRecord,
    Warnings,
    build_model,
    equilibrate,
    failure_reason,
    solve,
)
from tympan.studies.files import to_json
from tympan.studies.path import UNFOLLOWED, Stop, apart, stops
from tympan.studies.rows import rows_of
from tympan.studies.walk.film_point import FilmPoint
from tympan.studies.walk.flat_film import at_point, flat_limits, nominal

#: Longest step to a limit, relative to the frame's half extent: a cubic joins its ends. Steps of
#: 0.1 miss instabilities that last for a short way.
_LONG = 0.03

#: Relative difference below which two voltages count as equal.
_SAME = 1e-6


#: Field of several results: the stroke up to the first limit.
StrokeToLimit = Annotated[float | None, Key("deflection at the first limit, or as far as the film "
                                            "was followed, less that without voltage")]


@dataclass(frozen=True, eq=False)
class Rise:
    """Equilibria of a case while its voltage rises from 0 until the film ends, and its limits.

    ``cases`` belong to the ``stops``, at nominal voltages. Both are empty if there is no
    equilibrium without voltage; ``start`` is the status of that search.
    """

    model: Model
    start: Status
    cases: tuple[Case, ...]
    stops: tuple[Stop, ...]
    limits: Limits

    @property
    def rest(self) -> float | None:
        """Deflection without voltage [m]."""
        return self.stops[0].film.deflection if self.stops else None

    def before(self, case: Case) -> Solution | None:
        """Find the last stable equilibrium up to the voltage of a case; None without one."""
        stable = [stop.film.point.solution for stop in self.stops
                  if stop.film.voltage <= case.film_voltage and stop.film.model.wrinkles
                  and stop.film.point.solution.stable]
        return stable[-1] if stable else None

    @property
    def stroke(self) -> float | None:
        """Deflection at the first limit, or at the end, minus that without voltage [m]."""
        within = [stop for case, stop in zip(self.cases, self.stops, strict=True)
                  if self.limits.beyond(case.voltage) is None]
        if not within or self.rest is None:
            return None
        return within[-1].film.deflection - self.rest

    @property
    def warnings(self) -> list[str]:
        """Warnings about stretches on the way that are outside the range of the film's law.

        They name the voltage from which on the range is exceeded, unless it is exceeded without
        voltage. A warning that the film tears is given only before its first limit.
        """
        film = self.model.specimen.membrane
        films = [stop.film.fields for stop in self.stops]
        visits = [(fields.position, fields.stretch_1, fields.stretch_2) for fields in films]
        begins = next((case.voltage for case, visited in zip(self.cases, visits, strict=True)
                       if beyond_range(film, *visited)), None)
        if begins is None:
            return []
        beyond = self.limits.beyond(begins)
        if beyond and film.law_range is None:
            return []
        where = f" (from {begins / 1e3:.3g} kV on{', beyond the limit' if beyond else ''})"
        return [warning + where * (begins > 0)
                for warning in beyond_range(film, *map(np.concatenate, zip(*visits, strict=True)))]


@dataclass(frozen=True, kw_only=True)
class LimitsResult(SpecimenRecord):
    """Limits of one specimen under a load, in SI."""

    ending = "-limits"
    writer = "tympan limits"
    indexed = ("kind",)
    kinds = ("json",)

    mass_kg: float
    limits: Limits
    stroke_m: StrokeToLimit = None
    warnings: Warnings = ()

    def json(self) -> dict[str, Any]:
        """Convert to a JSON object; the limits are on the level of specimen and mass."""
        return {"specimen": self.specimen, "mass_kg": self.mass_kg, **to_json(self.limits),
                "stroke_m": self.stroke_m, "warnings": list(self.warnings)}

    @property
    def rows(self) -> dict[str, Array]:
        """Table with a row for each limit."""
        return rows_of(self.limits.told, specimen=self.specimen, mass_kg=self.mass_kg)

    @classmethod
    def of(cls, case: Case, settings: Settings, beyond: bool = False) -> LimitsResult:
        """Find the limits while the voltage of a case rises from 0.

        ``beyond`` is as in :func:`limits`.
        """
        risen = rise(case, settings, beyond=beyond)
        return cls(specimen=case.specimen.name, mass_kg=case.mass, limits=risen.limits,
                   stroke_m=risen.stroke, warnings=(*risen.warnings, *case.remarks))


def limits(case: Case, settings: Settings, beyond: bool = False) -> Limits:
    """Find the limits while the voltage of a case rises from 0; its own voltage is ignored.

    Voltages are nominal, as the rig's supply shows them. ``beyond``: if the film thins without
    bound before its pull-in, also find the pull-in of a film that cannot wrinkle, and continue far
    beyond its electric strength.
    """
    return rise(case, settings, beyond=beyond).limits


def first_limit(case: Case, settings: Settings) -> Limit | None:
    """Find only the first limit of :func:`limits`; this takes less time."""
    return rise(case, settings, first=True).limits.limit


def rise(case: Case, settings: Settings, first: bool = False, beyond: bool = False,
         step: float = _LONG) -> Rise:
    """Raise the voltage of a case from 0 to pull-in, instability, or a failed step.

    ``first``: stop at the first limit of any type. ``beyond``: if a wrinkled film thins without
    bound, continue to the pull-in of a film that cannot wrinkle, and far beyond the film's electric
    strength; no real film gets there.
    ``step``: the longest step, relative to the frame's half extent.
    """
    case = replace(case, voltage=0.0)
    model = build_model(case.specimen, settings, case.rig.loading)
    settings = settings.bounded(model)
    model, start = equilibrate(case, settings)
    if start.status != "equilibrium":
        ended = Limits({}, ended=_before_voltage(case, start, settings))
        return Rise(model, start.status, (), (), ended)
    if (flat := flat_limits(case, model, start, settings)) is not None:
        return Rise(model, start.status, (replace(case, voltage=0.0),),
                    (Stop(FilmPoint(model, at_point(start))),), flat)
    passed = list(_to_limit(case, model, start.state, settings, first, beyond, step))
    reached = _limits(case, passed)
    if reached.snap_through is not None and not first:
        back = _snap_back(case, model, passed, settings)
        reached = replace(reached, by_kind={**reached.by_kind, SNAP_BACK.kind: back})
    way = tuple(apart(passed))
    cases = tuple(replace(case, voltage=nominal(case, stop.film.voltage)) for stop in way)
    return Rise(model, start.status, cases, way, replace(reached, ended=_told(reached)))


def solve_within(case: Case, settings: Settings, film: bool = False) -> CaseResult:
    """Solve one case and find the limits of its film; no equilibrium beyond its end is sought.

    The voltage is applied last: if the film fails under its other loads, the result has that
    status. ``film``: include the fields on a surface.
    """
    began = time.perf_counter()
    result = _within(case, settings, film)
    return replace(result, warnings=(*result.warnings, *_without_direction(case)),
                   wall_s=time.perf_counter() - began)


def _without_direction(case: Case) -> list[str]:
    """Warn about parts of the rig that are left out without a voltage direction."""
    left_out = case.rig.hysteresis
    if case.direction or not left_out:
        return []
    return [f"{' and '.join(left_out)} of the rig {'are' if left_out[1:] else 'is'} left out, "
            "because nothing says which way the voltage was reached: give --direction up or down "
            "(in Python direction=1 or -1)"]


def _within(case: Case, settings: Settings, film: bool) -> CaseResult:
    within = rise(case, settings)
    reached = within.limits
    limit = reached.beyond(case.voltage)
    ended = limit is not None and limit == reached.end
    if within.start != "equilibrium" or ended:
        return CaseResult(
            specimen=case.specimen.name, mass_kg=case.mass, voltage_V=case.voltage,
            pressure_Pa=case.rig.gas_pressure or None,
            status="no_equilibrium" if ended else within.start, limits=reached,
            first=reached.first, limit=limit,
            dofs=build_model(case.specimen, settings, case.rig.loading).unknowns,
            wall_s=0.0, warnings=(reached.ended, *case.remarks))
    result = solve(case, settings, film, within.before(case))
    if limit is not None and limit.kind == INSTABILITY.kind and result.status != "equilibrium":
        result = replace(result, warnings=(reached.ended, *result.warnings))
    stroke = (result.deflection_m - within.rest
              if case.voltage and result.deflection_m is not None and within.rest is not None
              else None)
    return replace(result.showing(stroke_m=stroke), limits=reached, first=reached.first,
                   limit=limit)


def _to_limit(case: Case, model: Model, start: State, settings: Settings, first: bool,
              beyond: bool, step: float) -> Iterator[Stop]:
    """Yield stops up to the film's end.

    If a mechanism makes the plate snap, continue from the new equilibrium.
    """
    # If the mesh does not resolve the branch, the limits state their uncertainty.
    unchecked = replace(settings.path, unbalanced=np.inf)
    for stop in stops(case, model, start, "voltage", unchecked, step=step, beyond=beyond):
        landed = stop.landed(settings.path) if stop.happens(PULL_IN) else None
        if landed is not None:
            yield stop.at(SNAP_THROUGH)
            if not first:
                yield from _to_limit(case, model, landed.state, settings, first, beyond, step)
            return
        yield stop
        if stop.event is None:
            continue
        # A film that thins may be continued as one that cannot wrinkle, to its pull-in.
        gone = stop.happens(INSTABILITY) and not (beyond and stop.film.thins)
        if first or gone or stop.happens(PULL_IN):
            return


def _snap_back(case: Case, model: Model, passed: list[Stop], settings: Settings) -> Limit | None:
    """Find where the plate jumps back while the voltage falls from its first snap.

    None if it does not jump back down to 0 V.
    """
    snaps = next(number for number, stop in enumerate(passed) if stop.happens(SNAP_THROUGH))
    if snaps + 1 == len(passed):
        return None
    rest = passed[snaps + 1].film.point.state
    unchecked = replace(settings.path, unbalanced=np.inf)
    for stop in stops(case, model, rest, "voltage", unchecked, falling=True, step=_LONG):
        if stop.happens(PULL_IN):
            return _limit(case, stop.at(SNAP_BACK))
    return None


def _limits(case: Case, passed: list[Stop]) -> Limits:
    """Collect the first limit of each type on the way."""
    reached: dict[str, Limit] = {}
    thins = False
    for state in begun(passed[0].film) if passed else ():  # under the load without voltage
        film = passed[0].film
        x, y = film.place(state)
        limit = Limit(kind=state.kind, voltage_V=0.0, x_m=x, y_m=y, ring=case.axisymmetric,
                      segment=film.segment(state))
        reached[state.kind] = limit.of(case.specimen)
    for stop in passed:
        if stop.event is None:
            continue
        kind = stop.event.what
        if kind not in reached:
            reached[kind] = _limit(case, stop)
            thins |= kind == INSTABILITY.kind and stop.film.thins
    ended = passed[-1].ended if passed else UNFOLLOWED
    if passed and ended == UNFOLLOWED:
        followed = nominal(case, passed[-1].film.voltage)
        ended = f"the film could not be followed beyond {followed / 1e3:.4g} kV"
    tension, gone = reached.get(TENSION.kind), reached.get(INSTABILITY.kind)
    if gone is not None and thins:
        if tension is None or tension.voltage_V > gone.voltage_V:
            tension = replace(gone, kind=TENSION.kind)  # the film wrinkles before it thins
        if _same(tension, gone):
            gone = replace(tension, kind=INSTABILITY.kind)
        reached |= {TENSION.kind: tension, INSTABILITY.kind: gone}
    return Limits(reached, ended=f"no pull-in was found: {ended}", thins=thins)


def _limit(case: Case, stop: Stop) -> Limit:
    """Create the limit at a stop that reaches one."""
    assert stop.event is not None
    kind = stop.event.what
    state = LIMIT_STATES[kind]
    return Limit(kind=kind, voltage_V=nominal(case, stop.film.voltage), x_m=stop.event.x_m,
                 y_m=stop.event.y_m, spread=stop.event.spread,
                 at_edge=stop.film.on_electrode_edge(state),
                 at_corner=stop.film.at_sharp_corner(state), ring=case.axisymmetric,
                 segment=stop.event.segment).of(case.specimen)


def _same(first: Limit, second: Limit) -> bool:
    """Check whether two limits are reached at the same voltage."""
    return abs(first.voltage_V - second.voltage_V) <= _SAME * second.voltage_V


def _told(limits: Limits) -> str:
    """Explain in a sentence, with the limits' values, why the voltage was not raised further."""
    tension, gone, pull_in = limits.tension, limits.instability, limits.pull_in
    if limits.thins and gone is not None:
        thins = f"{INSTABILITY.label}: the film, wrinkled, thins without bound"
        if tension is None or _same(tension, gone):
            return f"{TENSION.at(gone.text)} and {thins}"
        return f"{tension.words} and, at {gone.text}, {thins}"
    if gone is not None:
        edge = ", at the electrode's edge" * gone.at_edge
        return f"{gone.words}{edge}, of the film itself, before a {PULL_IN.label} of the plate"
    return limits.ended if pull_in is None else pull_in.words


def _before_voltage(case: Case, outcome: Outcome, settings: Settings) -> str:
    """Explain why a film has no equilibrium without voltage, and name the rig's part in it."""
    if outcome.limited != "force" or outcome.thins or outcome.limit is None:
        return failure_reason(outcome)
    names = list(dict.fromkeys(bias.law.replace("_", " ") for bias in case.rig.biases))
    both = " and ".join(["weight", *names])
    force = case.force(build_model(case.specimen, settings, case.rig.loading).plate_area)
    words = (f"{both} {'pull' if names else 'pulls'} the plate in before any voltage: "
             f"{force:.3g} N is more than the film can carry")
    if not names:
        return f"{words} ({outcome.limit:.3g} N)"
    free = equilibrate(replace(case, rig=replace(case.rig, biases=())), settings)[1]
    cause = f"; without {' and '.join(names)} it carries that"
    return (f"{words} beside the {' and '.join(names)} ({outcome.limit:.3g} N)"
            f"{cause if free.status == 'equilibrium' else ''}")
