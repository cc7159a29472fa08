"""One case, or a path that starts from it, in equilibrium or in time, for commands and Python.

Quantities are SI numbers or texts with their unit; errors name the quantity.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from tympan.base.errors import InputError
from tympan.base.fields import number
from tympan.base.progress import Progress

if TYPE_CHECKING:
    from tympan.studies.case import Case, CaseResult, Settings
    from tympan.studies.path import PathResult
    from tympan.studies.trace import Responses

#: Longest time after the voltage was switched on [s], some thirty years.
_LONGEST = 1e9


def solve(case: Case, settings: Settings, after: float | str | None, film: bool) -> CaseResult:
    """Solve a case in equilibrium with its limits, or ``after`` a time since its voltage step."""
    if after is None:
        from tympan.studies.limits import solve_within

        return solve_within(case, settings, film)
    from tympan.studies.transient import solve_after

    passed = number(after, "time", "after")
    if not 0 <= passed < _LONGEST:
        raise InputError("must be 0 or positive", key="after", given=after)
    return solve_after(case, passed, settings, film)


def follow(case: Case, settings: Settings, along: Literal["voltage", "charge", "mass", "pressure"],
           rate: float | str | None, turn: float | str | None, fields: bool, beyond: bool,
           progress: Progress = lambda words: None) -> PathResult | Responses:
    """Follow equilibria from a case on, or at a ``rate`` a loop in time to a voltage ``turn``.

    ``fields``: include the film of every state, or at moments of the loop. ``beyond``: follow a
    wrinkled film that thins without bound on as one that cannot wrinkle; a loop does not.
    """
    if rate is None:
        from tympan.studies.path import path

        if turn is not None:
            raise InputError("is where a loop turns: rate must be given too", key="turn",
                             given=turn)
        return path(case, settings, along, progress, fields, beyond)
    if beyond:
        raise InputError("is for films at rest: a loop turns within its limits", key="beyond",
                         given=beyond)
    from tympan.studies.transient import MOMENTS_OF_LOOP, loop

    highest = None if turn is None else number(turn, "voltage", "turn")
    return loop(case, number(rate, "voltage rate", "rate"), highest, settings,
                MOMENTS_OF_LOOP if fields else 0)
