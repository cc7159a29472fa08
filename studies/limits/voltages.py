"""The voltages at which a film loses tension, breaks down and pulls in, in one pass."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tympan.fem.equilibrium.arc_length import PathPoint
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.model import Model
from tympan.studies.case import (
    Case,
    CaseResult,
    Limit,
    LimitKind,
    Limits,
    Settings,
    build_model,
    equilibrate,
    failure_reason,
    solve,
)
from tympan.studies.path import UNFOLLOWED, Stop, What, stops

Array = NDArray[np.float64]

_KINDS: dict[What, LimitKind] = {
    "tension lost": "tension", "breakdown": "breakdown", "limit": "pull_in"}

#: How far beyond the last point that could be followed a limit is searched for, relative.
_BEYOND = 1.5

#: Voltage [V] by which is seen what one does to a film that it does not move; any would do.
_TRIED = 1.0

#: How far, relative to the frame, a film may be from flat of which that is all that is known.
_FLAT = 1e-6


@dataclass(frozen=True, eq=False)
class Rise:
    """The equilibria of a case as its voltage rises from 0 until the film pulls in; its limits.

    ``cases`` are those of the ``stops``, at nominal voltages; none where there is no equilibrium
    without voltage.
    """

    model: Model
    cases: tuple[Case, ...]
    stops: tuple[Stop, ...]
    limits: Limits


def limits(case: Case, settings: Settings) -> Limits:
    """How far the voltage of a case can be raised from 0; its own voltage is not asked for.

    Voltages are nominal: those that the rig's supply shows.
    """
    return rise(case, settings).limits


def first_limit(case: Case, settings: Settings) -> Limit | None:
    """The first limit of :func:`limits`, sooner: the film is followed no further."""
    return rise(case, settings, first=True).limits.first


def rise(case: Case, settings: Settings, first: bool = False) -> Rise:
    """Raise the voltage of a case from 0 until the film pulls in, or cannot be followed.

    ``first``: only to the first limit of any kind.
    """
    case = replace(case, voltage=0.0)
    model, start = equilibrate(case, settings)
    if start.status != "equilibrium":
        return Rise(model, (), (), Limits(ended=failure_reason(start)))
    passed = list(_to_limit(case, model, start, settings, first))
    flat = _unmoved(case, model, start, settings) if len(passed) <= 1 else None
    if flat is not None:
        return Rise(model, (replace(case, voltage=0.0),), (Stop(model, _still(start)),), flat)
    reached = _limits(case, passed)
    wanted = reached.first if first else reached.pull_in
    if passed and wanted is None and (reached.end is None or reached.thins):
        reached = _searched(case, passed[-1], reached, settings)
    cases = tuple(replace(case, voltage=_nominal(case, stop)) for stop in passed)
    return Rise(model, cases, tuple(passed), reached)


def solve_within(case: Case, settings: Settings, film: bool = False) -> CaseResult:
    """One case with the limits of its film; beyond the pull-in nothing is searched for.

    ``film``: with its fields on a surface.
    """
    began = time.perf_counter()
    reached = limits(case, settings)
    # Where a film that thins would pull in is no limit of what it is.
    beyond = [limit for limit in (reached.end, reached.breakdown, reached.tension)
              if limit is not None and case.voltage > limit.voltage_V]
    limit = beyond[0] if beyond else None
    if limit is not None and limit == reached.end:
        return CaseResult(
            specimen=case.specimen.name, mass_kg=case.mass, voltage_V=case.voltage,
            pressure_Pa=case.rig.gas_pressure or None, status="no_equilibrium", limits=reached,
            limit=limit,
            dofs=build_model(case.specimen, settings, case.rig.loading).unknowns,
            wall_s=time.perf_counter() - began,
            warnings=(reached.ended,))
    return replace(solve(case, settings, film), limits=reached, limit=limit,
                   wall_s=time.perf_counter() - began)


def _to_limit(case: Case, model: Model, start: Outcome, settings: Settings, first: bool
              ) -> Iterator[Stop]:
    # Of a mesh that does not resolve the branch the limits say how certain they are.
    unchecked = replace(settings.path, unbalanced=np.inf)
    for stop in stops(case, model, start.state, "voltage", unchecked):
        yield stop
        if stop.event is not None and (first or stop.event.what == "limit"):
            return


def _searched(case: Case, last: Stop, reached: Limits, settings: Settings) -> Limits:
    """With the limit beyond the last point that could be followed, where a ramp meets one."""
    voltage, state = last.station.voltage_V, last.point.state
    outcome = equilibrium(last.model, state.force, _BEYOND * voltage, state.pressure,
                          last.point.solution, settings.path)
    if outcome.critical is None or outcome.limited != "voltage":
        return reached
    stop = Stop(last.model, outcome.critical)
    x, y = stop.place("limit")
    if outcome.kind == "thinning" and case.specimen.plate is None:
        thinned = Limit(kind="tension", voltage_V=_nominal(case, stop), x_m=x, y_m=y)
        return replace(reached, tension=reached.tension or thinned, thins=True,
                       ended=failure_reason(outcome))
    pull_in = Limit(kind="pull_in", voltage_V=_nominal(case, stop), x_m=x, y_m=y,
                    spread=stop.jump("limit"))
    ended = reached.ended if reached.thins else failure_reason(outcome)
    return replace(reached, ended=ended, pull_in=pull_in)


def _unmoved(case: Case, model: Model, start: Outcome, settings: Settings) -> Limits | None:
    """Of a film that the voltage only presses, flat in its frame and covered everywhere.

    It stays where it is: the Maxwell stress goes with U², the field with U. None of any other.
    """
    if model.specimen.plate is not None:
        return None
    flat = Stop(model, _still(start))
    charged = equilibrium(model, 0.0, _TRIED, start.state.pressure, settings=settings.path)
    if charged.status != "equilibrium":
        return None
    pressed = Stop(model, _still(charged))
    fall = flat.pressed.stress_2 - pressed.pressed.stress_2
    moved = np.abs(charged.state.positions - model.discretisation.reference).max()
    if not (fall > 0).all() or moved > _FLAT * model.size:
        return None
    share = pressed.fields.breakdown_share
    first: dict[LimitKind, Array] = {
        "tension": _TRIED * np.sqrt(np.maximum(flat.pressed.stress_2, 0.0) / fall),
        "breakdown": _TRIED / np.where(share > 0, share, 1e-300)}
    reached = {}
    for kind, voltages in first.items():
        place = int(np.argmin(voltages))
        x, y, _ = flat.fields.position[place]
        nominal = case.rig.nominal_voltage(float(voltages[place]), case.direction)
        reached[kind] = Limit(kind=kind, voltage_V=nominal, x_m=float(x), y_m=float(y))
    return Limits(tension=reached["tension"],
                  breakdown=reached["breakdown"] if share.any() else None,
                  ended="the film stays flat, the voltage moves nothing")


def _still(outcome: Outcome) -> PathPoint:
    return PathPoint(outcome.solution, (np.zeros(0), np.zeros(0)), np.inf)


def _nominal(case: Case, stop: Stop) -> float:
    return max(case.rig.nominal_voltage(stop.station.voltage_V, case.direction), 0.0)


def _limits(case: Case, passed: list[Stop]) -> Limits:
    """The first of each kind on the way."""
    reached: dict[LimitKind, Limit] = {}
    if passed and passed[0].station.least_stress_Pa <= 0:  # under the mass alone
        x, y = passed[0].place("tension lost")
        reached["tension"] = Limit(kind="tension", voltage_V=0.0, x_m=x, y_m=y)
    for stop in passed:
        if stop.event is not None:
            kind = _KINDS[stop.event.what]
            reached.setdefault(kind, Limit(kind=kind, voltage_V=_nominal(case, stop),
                                           x_m=stop.event.x_m, y_m=stop.event.y_m,
                                           spread=stop.event.spread))
    ended = passed[-1].ended if passed else UNFOLLOWED
    if passed and ended == UNFOLLOWED:
        ended = f"the film could not be followed beyond {_nominal(case, passed[-1]) / 1e3:.4g} kV"
    tension, pull_in = reached.get("tension"), reached.get("pull_in")
    thins = tension is not None and passed[0].model.wrinkles and not passed[-1].model.wrinkles
    if thins and tension is not None:
        ended = (f"the film loses tension at {tension.voltage_V / 1e3:.4g} kV and, wrinkled, thins "
                 "without bound")
    elif pull_in is not None:
        ended = f"the film pulls in at {pull_in.voltage_V / 1e3:.4g} kV"
    return Limits(tension=tension, breakdown=reached.get("breakdown"), pull_in=pull_in, ended=ended,
                  thins=thins)
