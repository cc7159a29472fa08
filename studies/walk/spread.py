"""Mesh error of a limit, from the jumps of its margin between elements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.fem.results.limit_states import INSTABILITY, LimitState, Sign
from tympan.studies.walk.film_point import FilmPoint


@dataclass(frozen=True, eq=False)
class Passage:
    """A limit state that a film reaches ``here``, between two near points of its branch.

    ``first`` is the first point of the branch. ``sign`` is the sign of the state that changes.
    """

    state: LimitState
    sign: Sign
    first: FilmPoint
    before: FilmPoint
    here: FilmPoint
    after: FilmPoint

    @cached_property
    def at_edge(self) -> bool:
        """Whether the limit begins at the edge of an electrode, within the film."""
        return self.sign.local and self.here.on_electrode_edge(self.state)

    @property
    def thins_at_edge(self) -> bool:
        """Whether the film thins at an electrode's edge."""
        return self.at_edge and self.here.thins

    @property
    def bends(self) -> bool:
        """Whether an electrode's edge itself becomes unstable."""
        return self.at_edge and not self.here.thins and self.state is INSTABILITY

    @property
    def kept(self) -> bool:
        """Whether a film with an electrode's edge that cannot wrinkle has a limit point here."""
        mesh, whole = self.here.model.discretisation, not self.sign.local
        kept = self.first.model.wrinkles and not self.here.model.wrinkles
        return kept and whole and bool(len(mesh.electrode_edge.every))

    @property
    def ends_wrinkled(self) -> bool:
        """Whether a wrinkled film ends here, because it would thin without bound beyond."""
        return self.after.thinned and self.before.wrinkled and self.here.thins

    @cached_property
    def around(self) -> tuple[FilmPoint, FilmPoint]:
        """Points between which the margin falls to its value here.

        A wrinkled film's margin jumps beyond its end, and falls ever faster before it. The points
        are then next to the end.
        """
        return (self.here.behind, self.here) if self.ends_wrinkled else (self.before, self.after)

    @property
    def unsteady(self) -> bool:
        """Whether the limit begins at an electrode's edge of a film not wrinkled before."""
        return (self.thins_at_edge or self.bends) and not self.around[0].wrinkled


@dataclass(frozen=True)
class Correction:
    """Correction of an error that jumps between elements underestimate, and its condition.

    ``factor``: multiplies the error of the margin. ``share``: least ratio of the growing quantity's
    change to the margin's decrease at the limit, relative to their mean ratio since the branch's
    first point. ``margin``: margin at that point.
    """

    applies: Callable[[Passage], bool]
    factor: float = 1.0
    share: float = 0.0
    margin: Callable[[Passage], float] = lambda passage: 0.0


#: Elements on one side of an electrode's edge have similar errors, so their jumps show only part of
#: the error. Where a wrinkled film ends there, the error was up to 1.47 times the estimate from
#: jumps (six meshes, three masses).
_ALIKE = Correction(lambda passage: passage.ends_wrinkled and passage.thins_at_edge, factor=1.5)

#: If an electrode's edge itself becomes unstable, the film next to it strains so fast that elements
#: half as large are hardly more accurate. Errors were up to 1.6 times the estimate from jumps (40
#: films, elements of a third of the size where errors were largest).
_BENT = Correction(lambda passage: passage.bends, factor=2.5)

#: A film that cannot wrinkle strains most at an electrode's edge, and its jumps show too little of
#: that. Errors were up to 2.3 times the estimate from jumps (29 films, elements half as large).
_KEPT = Correction(lambda passage: passage.kept, factor=2.5)

#: An unstable place at an electrode's edge thins ever faster, and sooner on a finer mesh. Therefore
#: the mean ratio from the start on is used, too. With it, errors were 0.04 to 0.23 of the spread
#: (four types of films, elements half as large).
_STEADY = Correction(lambda passage: passage.unsteady and passage.thins_at_edge, share=0.4,
                     margin=lambda passage: passage.sign.value(passage.first))

#: The same if the edge itself becomes unstable, by the stiffness of that edge alone. With 0.4 the
#: errors of two films of 54 were up to 1.9 times the stated ones (elements half as large).
_STEEP = Correction(lambda passage: passage.unsteady and passage.bends, share=0.8,
                    margin=lambda passage: passage.first.edge_firmness)

#: All corrections; those that apply to a limit are combined.
CORRECTIONS = (_ALIKE, _BENT, _KEPT, _STEADY, _STEEP)


def spread(passage: Passage, measured: Callable[[FilmPoint], float]) -> float:
    """Estimate the relative mesh error of the value at which a limit is reached.

    ``measured``: function that gives the growing quantity at a point of the branch.
    """
    sign, here = passage.sign, passage.here
    error = missed(passage)
    corrections = [each for each in CORRECTIONS if each.applies(passage)]
    for each in corrections:
        error *= each.factor
    if not sign.local:
        return error
    value, begun = measured(here), measured(passage.first)
    if not value:
        return 0.0
    before, after = passage.around
    fallen = max(abs(sign.value(before) - sign.value(after)), np.finfo(float).tiny)
    pace = abs(measured(after) - measured(before)) / fallen
    for each in corrections:
        if each.share and (margin := each.margin(passage)) > 0:
            pace = max(pace, each.share * abs(value - begun) / margin)
    return error * pace / abs(value)


def missed(passage: Passage) -> float:
    """Estimate the mesh error of a limit state's number, in its own unit.

    For a local number it is the sum of two parts: the jump between the elements that meet where the
    limit begins, and the change of the number with elements of one order less. Either part alone
    may be too small, if both sides have the same error or the order happens to change little. If a
    branch ends before the limit, the remaining margin is added. For a number of the whole film's
    energy it is the mean square of the jumps of its stress, over the variance of the stress.
    """
    state, sign, film = passage.state, passage.sign, passage.here
    if not film.model.meshed:
        return 0.0
    mesh, fields = film.model.discretisation, film.fields
    # At an electrode's edge the stress itself has a jump.
    sides = 2 * mesh.connectivity + (mesh.covered > 0)
    nodes: Numbers = np.unique(sides, return_inverse=True)[1].reshape(sides.shape)
    if not sign.local:
        stresses = (fields.stress_1, fields.stress_2)
        return float(max((_jumps(nodes, stress)**2).mean() / max(np.var(stress), 1e-300)
                         for stress in stresses))
    margins, values = state.field(film), state.by_element(film)
    place = int(np.argmin(margins))
    element = place // mesh.connectivity.shape[1]
    apart = abs(values[place] - margins[place]) if np.isfinite(values[place]) else 0.0
    jump = float(max(_jumps(nodes, values)[nodes[element]].max(), apart))
    coarser, left = film.coarser, sign.value(film)
    changed = abs(sign.value(coarser) - left) if coarser else 0.0
    return jump + changed + abs(left)


def _jumps(nodes: Numbers, values: Array) -> Array:
    """Compute the largest minus the smallest value at each node of the elements that meet there.

    ``nodes`` of the elements, shape (elements, local). ``values`` are element-major; infinite ones
    are ignored.
    """
    count, some = int(nodes.max()) + 1, np.isfinite(values)
    high, low = np.full(count, -np.inf), np.full(count, np.inf)
    np.maximum.at(high, nodes.ravel()[some], values[some])
    np.minimum.at(low, nodes.ravel()[some], values[some])
    return np.where(np.isfinite(high), high - low, 0.0)
