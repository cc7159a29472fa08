"""Equilibria of a plate that a mechanism makes jump, and all others under the same loads.

Beyond a limit point of its load a plate without inertia moves on to the first deflection at which
film and mechanism hold it again. The plate is held on the way, so that limit points do not matter.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from tympan.fem.equilibrium.arc_length import PathPoint
from tympan.fem.equilibrium.held_path import HeldInterval, crossings, held_path, with_tangent
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE

#: Deflections looked at in each interval where a mechanism softens: there the force bends.
_SOFT = 32
#: The same elsewhere: the force only grows there.
_FIRM = 8
#: Distance of the nearest deflection from the start, relative to the frame: far below what plates
#: jump that are not limited by a short interval. As many more are looked at where such an interval
#: begins, since it may have no end.
_NEAREST = 1e-3
#: Distance of one of them over that of the one before: the last is beyond the whole frame.
_WIDER = 1.25


def snapped(model: Model, limit: PathPoint, settings: PathSettings) -> Solution | None:
    """Equilibrium to which a plate jumps from a limit point of its load, which stays as it is.

    None without a mechanism that may make it jump, or where nothing holds it any more.
    """
    freedoms = list(model.plate_freedoms)
    if HEAVE not in freedoms:
        return None
    return landed(model, limit.solution, limit.direction[1][freedoms.index(HEAVE)], settings)


def landed(model: Model, start: Solution, way: float, settings: PathSettings) -> Solution | None:
    """Equilibrium to which a plate moves from a state that does not hold it, by the sign of a way.

    None where a mechanism cannot make it jump, or nothing holds it any more.
    """
    if not model.loading.softening:
        return None
    found = next(_equilibria(model, start, float(np.sign(way)), settings), None)
    return found if found is not None and _rests(model, found) else None


def resting(model: Model, reached: Solution, settings: PathSettings) -> list[Solution]:
    """All stable equilibria under the loads of a stable one, which is among them, by deflection."""
    others = [solution for way in (-1.0, 1.0)
              for solution in _equilibria(model, reached, way, settings)]
    return sorted([reached, *(other for other in others if _rests(model, other))],
                  key=lambda solution: model.deflection(solution.state))


def _rests(model: Model, solution: Solution) -> bool:
    return solution.stable and solution.thinning_margin(model) >= 0


def _equilibria(model: Model, start: Solution, way: float, settings: PathSettings
                ) -> Iterator[Solution]:
    """Equilibria under the loads of one that a held plate passes on one way (1 or -1) from there.

    The last interval in which a mechanism softens ends the search: a plate that is held back beyond
    it moves no further. A film that would thin without bound ends it, too.
    """
    return crossings(model, _ahead(model, start, way, settings), start.state.force, settings)


def _ahead(model: Model, start: Solution, way: float, settings: PathSettings
           ) -> Iterator[HeldInterval]:
    """Intervals that a held plate passes on its way from a start, without the one it starts in."""
    force = start.state.force
    places, last = _places(model, model.deflection(start.state), way, settings)
    if not places:
        return
    begun = False
    for step in held_path(model, places, with_tangent(model, start, settings), settings):
        where, forces, slopes = step.forces
        for number, (low, high) in enumerate(pairwise(where)):
            ends = slice(number, number + 2)
            if begun:
                excess = forces[ends] - force
                yield HeldInterval(low, high, excess, slopes[ends], step.span.foretold)
            begun = True
        held_back = way * (forces[-1] - force) > 0 and way * (where[-1] - last) >= 0
        if held_back or step.span.end.thinning_margin(model) < 0:
            return


def _places(model: Model, start: float, way: float, settings: PathSettings
            ) -> tuple[list[float], float]:
    """Deflections [m] of a plate on its way from a start, and the last where a mechanism softens.

    None where no mechanism softens on that way.
    """
    end = way * settings.reach * model.high
    marks = [way * float(np.clip(way * mark, way * start, way * end))
             for interval in model.loading.softening for mark in interval]
    last = way * max((way * mark for mark in marks), default=way * start)
    if way * (last - start) <= 0:
        return [], last
    ends = sorted({start, *marks, end}, key=lambda mark: way * mark)
    # An interval may be wide, or have no end: near to the start a plate is looked at closely.
    near = _NEAREST * model.size * _WIDER ** np.arange(_SOFT)
    parts: list[list[float]] = []
    for low, high in pairwise(ends):
        middle = (low + high) / 2
        soft = any(first < middle < second for first, second in model.loading.softening)
        parts.append(np.linspace(low, high, (_SOFT if soft else _FIRM) + 1)[1:].tolist())
        if soft:
            parts.append((low + way * near[near < abs(high - low)]).tolist())
    return sorted({place for part in parts for place in part},
                  key=lambda place: way * place), last
