"""How far a film can go: the voltages at which it first loses tension, breaks down and pulls in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from tympan.studies.case import Case, Settings, equilibrate, failure_reason
from tympan.studies.path import Event, What, legs

Kind = Literal["tension", "breakdown", "pull_in"]

_KINDS: dict[What, Kind] = {"tension lost": "tension", "breakdown": "breakdown", "limit": "pull_in"}

#: Longest step towards the limits, relative to the frame's half extent.
_STEP = 0.05


@dataclass(frozen=True, kw_only=True)
class Limit:
    """What happens first at a nominal voltage [V], and where in the mounted film [m].

    ``spread``: how certain the voltage is, relative.
    """

    kind: Kind
    voltage_V: float
    x_m: float | None = None
    y_m: float | None = None
    spread: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Limits:
    """The voltages at which a film under a mass first loses tension, breaks down and pulls in.

    None where that is not reached, of which ``warnings`` say the reason.
    """

    tension: Limit | None = None
    breakdown: Limit | None = None
    pull_in: Limit | None = None
    warnings: tuple[str, ...] = ()


def limits(case: Case, settings: Settings) -> Limits:
    """How far the voltage of a case can be raised from 0 under its mass.

    The case's own voltage is not asked for.
    """
    case = replace(case, voltage=0.0)
    model, start = equilibrate(case, settings)
    if start.status != "equilibrium":
        return Limits(warnings=(failure_reason(start),))
    passed: dict[Kind, Limit] = {}
    ended = ""
    for leg in legs(case, model, start.state, "voltage", settings.path, _STEP):
        for event in leg.events:
            passed.setdefault(_KINDS[event.what], _limit(case, event))
        ended = leg.ended
        if "pull_in" in passed:
            ended = ""
            break
    else:
        ended = ended or "the branch could not be followed further"
    return Limits(tension=passed.get("tension"), breakdown=passed.get("breakdown"),
                  pull_in=passed.get("pull_in"), warnings=(ended,) if ended else ())


def _limit(case: Case, event: Event) -> Limit:
    return Limit(kind=_KINDS[event.what],
                 voltage_V=case.rig.nominal_voltage(event.value, case.direction),
                 x_m=event.x_m, y_m=event.y_m)
