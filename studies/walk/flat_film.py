"""Limits of a flat film that no voltage moves, in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.equilibrium.arc_segment import PathPoint
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE, State
from tympan.fem.results.firmness import firmness, least_firmness
from tympan.fem.results.limit_states import (
    BREAKDOWN,
    INSTABILITY,
    LIMIT_STATES,
    TENSION,
    LimitState,
)
from tympan.fem.results.solved_states import mounted_place
from tympan.fem.rig import MOST_VOLTAGE
from tympan.fem.roots import root_between
from tympan.studies.case import Case, Limit, Limits, Settings
from tympan.studies.walk.film_point import FilmPoint

#: Test voltage [V] for a film that no voltage moves; its value is arbitrary.
_TRIED = 1.0

#: Relative distance from a flat film's loss of tension up to which instability is checked.
_TAUT = 1e-6

#: Relative difference from the highest voltage below which a voltage counts as it.
_SAME = 1e-6

#: Largest motion by a voltage that moves nothing, relative to the frame and to the share of the
#: stress that the voltage takes. Where an electrode covers a part, the motion is about that share.
_STIRS = 1e-3

#: Largest distance from flat of a film that counts as flat, relative to the frame.
_FLAT = 1e-6


def flat_limits(case: Case, model: Model, start: Outcome, settings: Settings) -> Limits | None:
    """Find the limits of a flat film, fully covered, that no voltage moves.

    It has no plate, or a fixed one. The Maxwell stress is proportional to U², the field to U. None
    for any other film.
    """
    if HEAVE in model.plate_freedoms or _away(model, start.state) > _FLAT * model.size:
        return None
    flat = FilmPoint(model, at_point(start))
    charged = equilibrium(model, 0.0, _TRIED, start.state.pressure, settings=settings.path)
    if charged.status != "equilibrium":
        return None
    pressed = FilmPoint(model, at_point(charged))
    fall = flat.pressed.stress_2 - pressed.pressed.stress_2
    if not (fall > 0).all():
        return None
    taken = float((fall / np.maximum(flat.pressed.stress_2, fall)).max())
    if _away(model, charged.state) > _away(model, start.state) + _STIRS * taken * model.size:
        return None
    share = pressed.fields.breakdown_share
    tension = _TRIED * np.sqrt(np.maximum(flat.pressed.stress_2, 0.0) / fall)
    first = {TENSION.kind: tension,
             BREAKDOWN.kind: _TRIED / np.where(share > 0, share, 1e-300)}
    reached = {kind: _flat_limit(case, flat, kind, float(each.min()), int(each.argmin()))
               for kind, each in first.items() if not _beyond_supply(case, float(each.min()))}
    reached |= _flat_states(case, flat, max((limit.voltage_V for limit in reached.values()),
                                            default=case.rig.most_film_voltage(case.direction)))
    gone = _flat_instability(case, flat, float(tension.min()))
    still = "no pull-in was found: the film stays flat, the voltage moves nothing"
    if gone is not None:
        reached[INSTABILITY.kind] = gone
    return Limits(reached, ended=still if reached else above_words(case))


def _flat_states(case: Case, flat: FilmPoint, highest: float) -> dict[str, Limit]:
    """Find where a flat film reaches further local limit states, up to a voltage [V]."""
    others = [state for kind, state in LIMIT_STATES.items()
              if state.local and kind not in (TENSION.kind, BREAKDOWN.kind, INSTABILITY.kind)]
    found = {state.kind: _flat_state(case, flat, state, highest) for state in others}
    return {kind: limit for kind, limit in found.items() if limit is not None}


def _flat_state(case: Case, flat: FilmPoint, state: LimitState, highest: float) -> Limit | None:
    """Find where a flat film reaches one limit state, up to a voltage [V]; None if it does not."""
    def field(voltage: float) -> Array:
        charged = flat.point.state.under(voltage=voltage**2)
        solution = replace(flat.point.solution, state=charged)
        return state.field(replace(flat, point=replace(flat.point, solution=solution)))

    def margin(voltage: float) -> float:
        return float(field(voltage).min(initial=np.inf))

    voltage = root_between(margin, 0.0, highest) if margin(0.0) > 0 else 0.0
    if voltage is None:
        return None
    return _flat_limit(case, flat, state.kind, voltage, int(np.argmin(field(voltage))))


def _away(model: Model, state: State) -> float:
    """Compute the largest distance of a node from the flat mounted film [m]."""
    return float(np.abs(state.positions - model.discretisation.reference).max())


def _flat_instability(case: Case, flat: FilmPoint, slack: float) -> Limit | None:
    """Find where a flat film becomes unstable before its loss of tension [V]; else None."""
    def state(voltage: float) -> State:
        return flat.point.state.under(voltage=voltage**2)

    def margin(voltage: float) -> float:
        return least_firmness(flat.model, state(voltage))

    taut = slack * (1 - _TAUT)
    if not margin(taut) < 0:
        return None
    voltage = root_between(margin, 0.0, taut) if margin(0.0) > 0 else 0.0
    if voltage is None or _beyond_supply(case, voltage):
        return None
    place = int(np.argmin(firmness(flat.model, state(voltage))))
    return _flat_limit(case, flat, INSTABILITY.kind, voltage, place)


def _flat_limit(case: Case, flat: FilmPoint, kind: str, voltage: float, place: int) -> Limit:
    x, y = mounted_place(flat.fields.position[place])
    return Limit(kind=kind, voltage_V=nominal(case, voltage), x_m=x, y_m=y,
                 ring=case.axisymmetric).of(case.specimen)


def at_point(outcome: Outcome) -> PathPoint:
    """Convert an equilibrium of a film that does not move to a point of its path."""
    return PathPoint(outcome.solution, (np.zeros(0), np.zeros(0)), np.inf)


def above_words(case: Case) -> str:
    """Explain why the voltage of a case is not raised further: its supply gives no more."""
    if case.rig.sag_voltage < MOST_VOLTAGE:
        most = case.rig.most_film_voltage(case.direction)
        return (f"the limit is above {most / 1e3:.4g} kV across the film, the most that the "
                "amplifier gives, since it sags")
    return f"the limit is above {MOST_VOLTAGE / 1e3:g} kV"


def nominal(case: Case, film_voltage: float) -> float:
    """Find the nominal voltage for a film voltage [V]."""
    return case.rig.shown_voltage(film_voltage, case.direction)


def _beyond_supply(case: Case, film_voltage: float) -> bool:
    """Check whether the supply cannot give a film a higher voltage [V]."""
    return film_voltage >= (1 - _SAME) * case.rig.most_film_voltage(case.direction)
