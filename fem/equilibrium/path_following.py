"""Continuation of a film's branch, beyond the loss of tension with smooth motions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain, dropwhile

from tympan.base.errors import InputError
from tympan.fem.equilibrium.arc_length import ArcSettings, Branch
from tympan.fem.equilibrium.arc_segment import PathPoint
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

#: Shortest step of a charged film, relative to the frame: its wrinkles may end in one spot.
_LOCAL = 1e-6

#: Least number of tangents that a search for the equilibrium of a large film may take.
_TANGENTS = 40

#: Work of a search for a film's limits, relative to :data:`WORK`: it follows a whole branch. Set by
#: trial: with 2, the limits of one film of 300 extreme ones took 62 s on a machine with other work.
_FOLLOWED = 1.6
#: Tangents of a search for a large film's limits, relative to ``_TANGENTS``, unless more loads need
#: more. Limits of 13 random films took 45 to 142 tangents. 200 tangents of 50,000 unknowns take up
#: to a minute.
_FOLLOWED_FAR = 5.0

#: Work to follow a film beyond its last equilibrium, relative to a search for an equilibrium. No
#: real film gets there, so it is worth less than the path up to the limit.
_BEYOND = 1.5


@dataclass(frozen=True)
class PathSettings:
    """Settings of the steps of a load ramp.

    ``first``: first step as a share of the ramp. ``handover``: step, relative to the load or U²
    reached, below which arc-length continuation replaces the ramp. ``shortest``: step of a held
    plate below which the path is given up. ``reach``: deflection, relative to the frame's half
    extent, at which a search for an equilibrium ends.

    ``smooth``: numbers of waves around the plate, and polynomial degrees between plate and frame,
    of the smooth motions of a film under compression. ``annular``: these degrees for an
    axisymmetric film. ``unbalanced``: largest nodal force that smooth motions may leave, relative
    to the largest force, for a mesh that resolves them.
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
        """Add a budget of work, so that a search ends; an existing budget stays.

        ``followed``: the search follows a branch, to a film's limits or over many ``loads``.
        """
        if self.newton.budget is not None:
            return self
        work, tangents = (WORK * _FOLLOWED, _TANGENTS * max(_FOLLOWED_FAR, loads)) if followed \
            else (WORK, _TANGENTS)
        budget = Budget(max(work, tangents * tangent_work(model)))
        return replace(self, newton=replace(self.newton, budget=budget))

    def beyond_end(self, model: Model) -> PathSettings:
        """Reduce the work for a film without wrinkles beyond its last equilibrium."""
        budget = self.newton.budget
        if budget is None:
            return self
        budget = budget.part(_BEYOND * max(WORK, _TANGENTS * tangent_work(model)))
        return replace(self, newton=replace(self.newton, budget=budget))

    @property
    def exhausted(self) -> bool:
        """Whether a search has used all its work."""
        return self.newton.budget is not None and self.newton.budget.spent

    def require_work(self, key: str) -> None:
        """Raise InputError if a search used all its work, so the result is incomplete."""
        if self.exhausted:
            raise InputError(f"{EXHAUSTED}: {LIGHTER}", key=key)

    def subspaces(self, model: Model) -> Iterator[SmoothSubspace]:
        """Yield subspaces of smooth motions of a model.

        The motions of an axisymmetric model have no waves. A film without a plate has no subspaces,
        since the waves are defined around the plate; nor has one without elements.
        """
        if model.specimen.plate is None or not model.meshed:
            return iter(())
        kinds = [(0, degree) for degree in self.annular] if model.axisymmetric else self.smooth
        return (SmoothSubspace.of(model, *kind) for kind in kinds)


def follow_branch(model: Model, start: State, load: Load, settings: PathSettings = PathSettings(),
                  sense: int = 1, beyond: bool = False) -> Iterator[tuple[Branch, PathPoint]]:
    """Yield points from an equilibrium on, each with the branch that contains it.

    At first the load increases (``sense`` 1) or decreases (−1). All motions are allowed as long as
    the film has an equilibrium. A film may be taut up to where, wrinkled, it would thin without
    bound. It is then continued as a film that bears compression, with smooth motions. With
    ``beyond``, the continuation starts at the first point beyond the loss of tension, which is also
    yielded.

    On some meshes the load turns because one place thins ever faster. This is no limit point of the
    plate, and no point beyond it is yielded. A film that is wrinkled before it would thin ends
    there. Only its last point is then beyond the end, as its thinning margin shows.
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
        # The first smooth point is the last point again.
        if next(points, None) is not None and (first := next(points, None)) is not None:
            yield from ((smooth, point) for point in dropwhile(
                lambda point: length(model, difference(model, point.state, last)) < passed,
                chain((first,), points)))
            return
