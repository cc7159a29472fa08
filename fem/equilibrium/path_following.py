"""A film's branch of equilibria followed on, past the loss of tension with smooth motions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain, dropwhile

from tympan.base.errors import InputError
from tympan.fem.equilibrium.arc_length import ArcSettings, Branch, PathPoint
from tympan.fem.equilibrium.constraints import difference, length
from tympan.fem.equilibrium.newton import (
    EXHAUSTED,
    LIGHTER,
    WORK,
    Budget,
    NewtonSettings,
    tangent_work,
)
from tympan.fem.equilibrium.subspace import SmoothSubspace
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import Load, State

#: Shortest step, relative to the frame, of a charged film: its wrinkles may end in one spot.
_LOCAL = 1e-6

#: Tangents that the search for an equilibrium of a large film has at least.
_TANGENTS = 40

#: How many times that work the search for a film's limits may take: it follows a whole branch. Set
#: by trial: with 2, the limits of a film of 300 extreme ones took 62 s where others worked, too.
_FOLLOWED = 1.6
#: How many times those tangents a large film may take in it, if not more loads ask for more: limits
#: of 13 random films took 45 to 142 tangents, and 200 of 50,000 unknowns take up to a minute.
_FOLLOWED_FAR = 5.0

#: How many times the work of a search for an equilibrium it may take to follow a film beyond its
#: end: no film gets there, so it is worth less than the way to the end.
_BEYOND = 1.5


@dataclass(frozen=True)
class PathSettings:
    """Steps of a ramp.

    ``first``: first step as a share of the ramp; ``handover``: step, relative to the load or U²
    reached, below which the ramp is followed by its arc length instead; ``shortest``: step of a
    held plate at which to give up; ``reach``: deflection, relative to the frame's half extent, at
    which a search for equilibrium ends; ``smooth``: numbers of waves around the plate, and degrees
    between plate and frame, of the smooth motions of a film that bears compression, ``annular``
    those degrees where it is axisymmetric; ``unbalanced``: nodal force that these may leave,
    relative to the largest, if the mesh is to resolve them.
    """

    newton: NewtonSettings = field(default_factory=NewtonSettings)
    arc: ArcSettings = field(default_factory=ArcSettings)
    first: float = 1.0
    handover: float = 1e-2
    shortest: float = 2e-4
    reach: float = 1.5
    smooth: tuple[tuple[int, int], ...] = ((4, 14), (6, 6), (4, 10), (2, 14))
    annular: tuple[int, ...] = (14, 10, 20)
    unbalanced: float = 1e-2

    def bounded(self, model: Model, followed: bool = False, loads: int = 1) -> PathSettings:
        """Settings with a budget of work, so that a search ends; unchanged if they have one.

        ``followed``: along a branch, to a film's limits or over many ``loads``.
        """
        if self.newton.budget is not None:
            return self
        work, tangents = (WORK * _FOLLOWED, _TANGENTS * max(_FOLLOWED_FAR, loads)) if followed \
            else (WORK, _TANGENTS)
        budget = Budget(max(work, tangents * tangent_work(model)))
        return replace(self, newton=replace(self.newton, budget=budget))

    def beyond_end(self, model: Model) -> PathSettings:
        """Settings with less work, for a film beyond its end that is kept from wrinkling."""
        budget = self.newton.budget
        if budget is None:
            return self
        budget = budget.part(_BEYOND * max(WORK, _TANGENTS * tangent_work(model)))
        return replace(self, newton=replace(self.newton, budget=budget))

    @property
    def exhausted(self) -> bool:
        """Whether a search has done all the work that it may."""
        return self.newton.budget is not None and self.newton.budget.spent

    def require_work(self, key: str) -> None:
        """Refuse what is not complete: InputError where a search has done all its work."""
        if self.exhausted:
            raise InputError(f"{EXHAUSTED}: {LIGHTER}", key=key)

    def subspaces(self, model: Model) -> Iterator[SmoothSubspace]:
        """Smooth motions of a model: without waves where it is axisymmetric.

        None of a film without plate, whose motions are no waves around one.
        """
        if model.specimen.plate is None:
            return iter(())
        kinds = [(0, degree) for degree in self.annular] if model.axisymmetric else self.smooth
        return (SmoothSubspace.of(model, *kind) for kind in kinds)


def follow_branch(model: Model, start: State, load: Load, settings: PathSettings = PathSettings(),
                  sense: int = 1, beyond: bool = False) -> Iterator[tuple[Branch, PathPoint]]:
    """Points from an equilibrium on, each with the branch it is on.

    One load grows at first (``sense`` 1) or falls (−1). With all motions as far as the film has an
    equilibrium. A film that is taut until, wrinkled, it would thin without bound, is followed on as
    one that bears compression, with smooth motions; with ``beyond`` from the first point beyond the
    loss of tension on, which is then among the points. Where one place thins ever faster, the load
    turns on some meshes: no limit of the plate, and no point beyond is given. A film that is
    wrinkled before it would thin ends there: of its points the last alone is beyond, as its margin
    to thinning says.
    """
    last, passed = start, 0.0
    shortest, charged = settings.arc.shortest, load == "voltage" or start.voltage_squared > 0
    fine = min(shortest, _LOCAL) if model.wrinkles and charged else shortest
    branch = Branch(model, load, newton=settings.newton,
                    arc=replace(settings.arc, shortest=fine))
    for point in branch.points(start, sense):
        thinned = model.wrinkles and model.thinning_margin(point.state) < 0
        pressed = thinned or not model.wrinkles
        loose = model.wrinkles and not model.in_tension(last)
        if pressed and loose and model.thinning_margin(last) >= 0:
            yield branch, point
            return
        turned = point.rate * sense < 0
        if (pressed and (loose or point.solution.wrinkling)) or (thinned and turned):
            if beyond and not loose and point.rate * sense > 0:
                yield branch, point
                passed = length(model, difference(model, point.state, last))
            break
        yield branch, point
        last, sense = point.state, sense if point.rate * sense >= 0 else -sense
    if model.wrinkles and not model.in_tension(last) and model.thinning_margin(last) >= 0:
        return
    if settings.exhausted:
        return
    if model.wrinkles:
        settings, model = settings.beyond_end(model), replace(model, wrinkles=False)
        branch = replace(branch, newton=settings.newton)
    for subspace in settings.subspaces(model):
        smooth = replace(branch, model=model, subspace=subspace, arc=settings.arc)
        points = smooth.points(last, sense)
        # The first point is the last one again, by smooth motions.
        if next(points, None) is not None and (first := next(points, None)) is not None:
            yield from ((smooth, point) for point in dropwhile(
                lambda point: length(model, difference(model, point.state, last)) < passed,
                chain((first,), points)))
            return
