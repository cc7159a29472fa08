"""Equilibria after a mechanism makes the plate jump, and all equilibria under the same loads.

At a limit point of its load a plate without inertia jumps to the next deflection at which film and
mechanism hold it in equilibrium. The search prescribes the deflection, so that limit points need no
special treatment.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from tympan.fem.equilibrium.arc_segment import PathPoint
from tympan.fem.equilibrium.held_path import HeldInterval, crossings, held_path, with_tangent
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE

#: Deflections in each interval where a mechanism softens: the force has curvature there.
_SOFT = 32
#: Deflections in each other interval, where the force only increases.
_FIRM = 8
#: Distance of the closest deflection to the start, relative to the frame. It is far below the jumps
#: of plates that no short interval limits. ``_SOFT`` further deflections are added where such an
#: interval begins, since it may have no end.
_NEAREST = 1e-3
#: Ratio of the distances of successive deflections: the last one is beyond the whole frame.
_WIDER = 1.25


def snapped(model: Model, limit: PathPoint, settings: PathSettings) -> Solution | None:
    """Find the equilibrium to which a plate jumps from a limit point, at constant load.

    None if no mechanism can make it jump, or if there is no further equilibrium.
    """
    freedoms = list(model.plate_freedoms)
    if HEAVE not in freedoms:
        return None
    return landed(model, limit.solution, limit.direction[1][freedoms.index(HEAVE)], settings)


def landed(model: Model, start: Solution, way: float, settings: PathSettings) -> Solution | None:
    """Find the equilibrium to which a plate moves from a state without equilibrium.

    The sign of ``way`` is the direction of the motion. None if no mechanism can make the plate
    jump, or if there is no further equilibrium.
    """
    if not model.loading.softening:
        return None
    found = next(_equilibria(model, start, float(np.sign(way)), settings), None)
    return found if found is not None and _rests(model, found) else None


def resting(model: Model, reached: Solution, settings: PathSettings) -> list[Solution]:
    """Find all stable equilibria under a stable one's loads, itself included, by deflection."""
    others = [solution for way in (-1.0, 1.0)
              for solution in _equilibria(model, reached, way, settings)]
    return sorted([reached, *(other for other in others if _rests(model, other))],
                  key=lambda solution: model.deflection(solution.state))


def _rests(model: Model, solution: Solution) -> bool:
    return solution.stable and solution.thinning_margin(model) >= 0


def _equilibria(model: Model, start: Solution, way: float, settings: PathSettings
                ) -> Iterator[Solution]:
    """Yield equilibria that a held plate passes in one direction (1 or -1), at equal loads.

    The last interval in which a mechanism softens ends the search: a plate that is pushed back
    beyond it moves no further. A film that would thin without bound ends the search, too.
    """
    return crossings(model, _ahead(model, start, way, settings), start.state.force, settings)


def _ahead(model: Model, start: Solution, way: float, settings: PathSettings
           ) -> Iterator[HeldInterval]:
    """Yield the intervals that a held plate passes from a start, except the first one."""
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
    """List deflections [m] from a start in one direction, and the last where a mechanism softens.

    The list is empty if no mechanism softens in that direction.
    """
    end = way * settings.reach * model.high
    marks = [way * float(np.clip(way * mark, way * start, way * end))
             for interval in model.loading.softening for mark in interval]
    last = way * max((way * mark for mark in marks), default=way * start)
    if way * (last - start) <= 0:
        return [], last
    ends = sorted({start, *marks, end}, key=lambda mark: way * mark)
    # An interval may be wide or have no end: deflections near the start are closely spaced.
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
