"""Growth of force laws to the reach of readings: first sizes of each effect, then larger ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeVar

import numpy as np

from tympan.base.arrays import Array
from tympan.base.extras import MissingPackage
from tympan.base.progress import PartsDone
from tympan.base.system import MissingLibrary
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis
from tympan.studies.diagnosis.reduced.axes import (
    FIRST_SPAN,
    Axis,
    HeldFilm,
    Sample,
    acting_together,
    film_axes,
    sampled_film,
)
from tympan.studies.diagnosis.reduced.force_law import FORCE, ForceLaw, Grid, SampledForce, Solver
from tympan.studies.diagnosis.reduced.reduced_films import ReducedFilms, affected
from tympan.studies.effects import Setup
from tympan.studies.parallel import mapped

AnyFilms = TypeVar("AnyFilms", bound=ReducedFilms)
Solve = Callable[[HeldFilm, Grid, Sequence[HeldFilm]], Array]

#: Factor by which the largest size sampled grows in one step. Set by trial.
_GROWTH = 1.8
#: Share of the largest size reachable from which on it grows to that in one step.
_ALMOST = 0.8

#: Shares of the step at which a film is tried instead if it cannot be solved.
_SHARES = (0.5, 0.25, 0.1)

#: Relative difference within which sizes beyond the first places are equal.
_ALIKE = 0.05
#: Relative difference within which sizes between the first places are equal: interpolation is
#: better there.
_ALIKE_INSIDE = 0.2
#: Standard deviations below which sizes count as none.
_NONE = 0.02

#: Least share of the grid's highest U² up to which a film with effects must be solved.
_LOWEST = 0.4

#: Number of samples that take less time than the start of processes.
_FEW = 24

#: Most samples of several effects together: distant ones have little weight.
_MOST = 12


@dataclass(frozen=True)
class Chain:
    """Samples of one film to solve one after another, each from those before.

    ``behind`` have been solved before. The chain ends at a sample that fails; a ``patient`` one
    tries samples nearer to the last one first. If ``exact``, all nodes of the grid are solved for
    any size.
    """

    solver: Solver
    setup: Setup
    name: str
    grid: Grid
    axes: tuple[Axis, ...]
    samples: tuple[Sample, ...]
    behind: tuple[Sample, ...] = ((),)
    patient: bool = False
    exact: bool = False

    @classmethod
    def along(cls, base: Chain, number: int, places: Iterable[float],
              behind: Iterable[float] = ()) -> Chain:
        """Set up a chain over sizes of one axis."""
        return replace(base, samples=tuple(((number, place),) for place in places),
                       behind=((), *(((number, place),) for place in behind)), patient=True)

    def run(self) -> SolvedGrid:
        """Solve all samples."""
        return self._followed(self.solver.solved)

    def at_once(self) -> SolvedGrid | None:
        """Look up all samples; None if one of them is not stored."""
        def stored(film: HeldFilm, grid: Grid, near: Sequence[HeldFilm]) -> Array:
            values = self.solver.stored(film, grid)
            if values is None:
                raise LookupError
            return values

        try:
            return self._followed(stored)
        except LookupError:
            return None

    def _followed(self, solve: Solve) -> SolvedGrid:
        answers: dict[Sample, SampledForce] = {}
        near = [self._film(sample) for sample in self.behind]
        last, failure = self.behind[-1] if self.behind else (), None
        for sample in self.samples:
            tries = [sample, *(_between(last, sample, share)
                               for share in _SHARES if self.patient)]
            for trial in tries:
                try:
                    film = self._film(trial)
                    answers[trial] = self._sampled(solve, film, self._grid(trial), near)
                except (MissingLibrary, MissingPackage):
                    raise
                except (ArithmeticError, ValueError, RuntimeError) as error:
                    failure = failure or error
                else:
                    near.append(film)
                    last = trial
                    break
            if failure:
                break
        return SolvedGrid(self, answers, failure)

    def _sampled(self, solve: Solve, film: HeldFilm, grid: Grid,
                 near: Sequence[HeldFilm]) -> SampledForce:
        """Solve a film on the grid, or up to a lower voltage if it fails at the highest."""
        least = _LOWEST * grid.voltage_squared if near else 0.0
        while True:
            values = solve(film, grid, near)
            failing = np.flatnonzero(np.isnan(values[FORCE]).any(axis=0))
            if not len(failing):
                return SampledForce(grid, values)
            squares = grid.highest
            reached = squares[failing[0] - 1] if failing[0] else 0.0
            # The next attempt ends half way to the failure; the nodes end somewhat below the grid.
            top = (reached + squares[failing[0]]) / 2 * grid.voltage_squared / squares.max()
            grid = replace(grid, voltage_squared=min(top, 0.9 * grid.voltage_squared))
            if grid.voltage_squared < max(least, 1.0):
                raise ArithmeticError("the film could not be solved with its plate held at "
                                      f"{squares[failing[0]] ** 0.5:.4g} V")

    def _grid(self, sample: Sample) -> Grid:
        """Choose the grid: few nodes for small effects, all for large ones and the film itself."""
        if self.exact:
            return self.grid
        small = all(abs(size) <= 1.01 * FIRST_SPAN * self.axes[number].parameter.deviation
                    for number, size in sample)
        return self.grid.coarse if sample and small else self.grid

    def _film(self, sample: Sample) -> HeldFilm:
        return sampled_film(self.setup, self.name, self.axes, sample)


@dataclass(frozen=True, eq=False)
class SolvedGrid:
    """Answer of a chain: values by sample, and the failure that ended it early."""

    chain: Chain
    answers: dict[Sample, SampledForce]
    failure: Exception | None


def _between(start: Sample, end: Sample, share: float) -> Sample:
    """Make a sample of one axis on the way to another."""
    (number, far), = end
    near = start[0][1] if start else 0.0
    return ((number, near + share * (far - near)),)


def _run(chain: Chain) -> SolvedGrid:
    return chain.run()


def solve_chains(chains: Sequence[Chain], workers: int,
                 progress: PartsDone = lambda done, all_of_them: None) -> list[SolvedGrid]:
    """Solve chains in processes, except those that are stored."""
    solved = [chain.at_once() for chain in chains]
    missing = [chain for chain, answer in zip(chains, solved, strict=True) if answer is None]
    count = sum(len(chain.samples) for chain in missing)
    with closing(mapped(_run, missing, workers if count > _FEW else 1)) as answers:
        for done, number in enumerate(n for n, answer in enumerate(solved) if answer is None):
            solved[number] = next(answers)
            progress(done, len(missing))
    return [answer for answer in solved if answer is not None]


def extended_law(law: ForceLaw, solved: Iterable[SolvedGrid]) -> ForceLaw:
    """Add the answers of chains to a law; an axis whose chain ended early ends there."""
    axes, more = list(law.axes), dict[Sample, SampledForce]()
    for answer in solved:
        more |= answer.answers
        for sample in answer.answers:
            if len(sample) == 1:
                (number, size), = sample
                axes[number] = axes[number].with_place(size)
        if answer.chain.patient and answer.failure:
            (number, size), = answer.chain.samples[-1]
            axes[number] = axes[number].ended(1 if size > 0 else -1, str(answer.failure))
    law = law.with_samples(tuple(axes), more)
    return replace(law, grid=law.samples[()].grid)


def first_laws(solver: Solver, setup: Setup, grids: Sequence[Grid], workers: int = 1,
               progress: PartsDone = lambda done, all_of_them: None, shapes: bool = False,
               slopes: bool = False) -> tuple[ForceLaw, ...]:
    """Sample the force law of every specimen of a setup, each effect alone at its first sizes.

    With ``shapes`` the axes include effects that only the films' shapes show, with ``slopes``
    those that the plates' slopes show.
    """
    laws = [ForceLaw(solver, grid, film_axes(setup, specimen.name, shapes, slopes), {})
            for specimen, grid in zip(setup.specimens, grids, strict=True)]
    return _sampled(setup, laws, [acting_together(law.axes) for law in laws], workers, progress)


def regridded(simulation: AnyFilms, grids: Sequence[Grid], workers: int = 1) -> AnyFilms:
    """Solve the same samples on other grids, as far as the films can be solved there."""
    laws = [replace(law, grid=grid) for law, grid in zip(simulation.laws, grids, strict=True)]
    joint = [[(sample,) for sample in law.samples if len(sample) > 1] for law in laws]
    return replace(simulation, laws=_sampled(simulation.setup, laws, joint, workers))


def _sampled(setup: Setup, laws: Sequence[ForceLaw],
             joint: Sequence[Sequence[tuple[Sample, ...]]], workers: int,
             progress: PartsDone = lambda done, all_of_them: None) -> tuple[ForceLaw, ...]:
    """Solve laws at all places of their axes, and joint samples."""
    chains: list[Chain] = []
    for number, (specimen, law) in enumerate(zip(setup.specimens, laws, strict=True)):
        base = _base(setup, specimen.name, law)
        chains.append(replace(base, samples=((),), behind=()))
        # Films on meshes of their own take longest; they belong to the last effects.
        chains += [Chain.along(base, axis, places) for axis in reversed(range(len(law.axes)))
                   for sense in (1, -1) if (places := law.axes[axis].side(sense))]
        chains += [replace(base, samples=samples) for samples in joint[number]]
    solved = solve_chains(chains, workers, progress)
    for answer in solved:
        if answer.chain.samples == ((),) and answer.failure:
            raise answer.failure
    sampled = []
    for specimen, law in zip(setup.specimens, laws, strict=True):
        axes = tuple(replace(axis, places=()) for axis in law.axes)
        sampled.append(extended_law(replace(law, axes=axes, samples={}), [
            answer for answer in solved if answer.chain.name == specimen.name]))
    return tuple(sampled)


def _base(setup: Setup, name: str, law: ForceLaw) -> Chain:
    """Make a chain of a law's film without samples."""
    return Chain(law.solver, setup, name, law.grid, law.axes, ())


def grown(simulation: AnyFilms, cause: Cause, index: int, side: int,
          workers: int = 1) -> AnyFilms:
    """Sample films at a larger size of a parameter of an effect, on side +1 or -1.

    The same object is returned if the parameter changes no film, or no film bears more.
    """
    places = affected(simulation, cause, index)
    if not places:
        return simulation
    ranges = [(axis.span(side), axis.reach(side))
              for axis in (simulation.laws[law].axes[number] for law, number in places)]
    now, most = min(span for span, _ in ranges), min(reach for _, reach in ranges)
    if now >= most * (1 - _ALIKE / 10):
        return simulation
    wanted = _GROWTH * now if now > 0 else cause.effect.parameters[index].deviation
    wanted = most if wanted > _ALMOST * most else wanted
    chains = []
    for (law, number), (span, _) in zip(places, ranges, strict=True):
        if span < wanted * (1 - _ALIKE):
            axis = simulation.laws[law].axes[number]
            sense = 1 if axis.folded else side
            chains.append(Chain.along(_chain_of(simulation, law), number, [sense * wanted],
                                      axis.side(sense)))
    return _with_answers(simulation, solve_chains(chains, workers))


def refined(simulation: AnyFilms, hypothesis: Hypothesis, unknowns: Array,
            workers: int = 1) -> AnyFilms:
    """Solve the films at the sizes of a hypothesis' unknowns, and their pairs.

    The same object is returned if they are solved already, or cannot be.
    """
    chains = []
    for law_number, law in enumerate(simulation.laws):
        sizes = simulation.axis_sizes(law_number, hypothesis, unknowns)
        active = [number for number, size in enumerate(sizes.tolist())
                  if abs(size) > _NONE * law.axes[number].parameter.deviation]
        base = replace(_chain_of(simulation, law_number), exact=True)
        for number in active:
            chains += _single(base, law, number, float(sizes[number]))
        groups = {2, len(active)} if len(active) > 1 else set()
        for group in (group for count in sorted(groups) for group in combinations(active, count)):
            sample = tuple((number, float(sizes[number])) for number in group)
            if not _near_another(law, sample):
                chains.append(replace(base, samples=(sample,)))
    return _with_answers(simulation, solve_chains(chains, workers))


def coupled(simulation: AnyFilms, hypotheses: Sequence[Hypothesis],
            unknowns: Sequence[Array], workers: int = 1) -> AnyFilms:
    """Solve a film for every two parameters whose joint effect is not known.

    They have the sizes of the hypotheses' unknowns. The same object is returned if there are none,
    or none can be solved.
    """
    chains = []
    for law_number, law in enumerate(simulation.laws):
        base = _chain_of(simulation, law_number)
        groups = {tuple(number for number, _ in sample) for sample in law.samples}
        for hypothesis, values in zip(hypotheses, unknowns, strict=True):
            sizes = simulation.axis_sizes(law_number, hypothesis, values)
            for group in combinations(np.flatnonzero(sizes).tolist(), 2):
                if group not in groups:
                    groups.add(group)
                    sample = tuple((number, float(sizes[number])) for number in group)
                    chains.append(replace(base, samples=(sample,)))
    return _with_answers(simulation, solve_chains(chains, workers))


def _single(base: Chain, law: ForceLaw, number: int, size: float) -> list[Chain]:
    """Choose a place at a size, or one near it, if not all nodes were solved there."""
    axis, sense = law.axes[number], 1 if size > 0 else -1
    side = axis.side(sense)
    size = sense * min(abs(size), axis.reach(sense))
    inside = abs(size) <= min(FIRST_SPAN * axis.parameter.deviation, axis.span(sense))
    near = [place for place in side
            if abs(size - place) < (_ALIKE_INSIDE if inside else _ALIKE) * abs(size)]
    if near:
        size = min(near, key=lambda place: abs(size - place))
        if not law.samples[((number, size),)].grid.some:
            return []
    below = [place for place in side if abs(place) < abs(size)]
    patient = below == [*side]
    return [replace(Chain.along(base, number, [size], below), patient=patient)]


def _near_another(law: ForceLaw, sample: Sample) -> bool:
    """Check whether the same axes have a sample near this one, or enough of them."""
    group = [number for number, _ in sample]
    others = [other for other in law.samples if [number for number, _ in other] == group]
    return len(others) >= _MOST or any(
        all(abs(size - there) < _ALIKE * abs(size)
            for (_, size), (_, there) in zip(sample, other, strict=True)) for other in others)


def _chain_of(simulation: ReducedFilms, law: int) -> Chain:
    return _base(simulation.setup, simulation.setup.specimens[law].name, simulation.laws[law])


def _with_answers(simulation: AnyFilms, solved: Sequence[SolvedGrid]) -> AnyFilms:
    names = [specimen.name for specimen in simulation.setup.specimens]
    changed = {answer.chain.name for answer in solved if answer.answers or answer.chain.patient}
    if not changed:
        return simulation
    answers = {name: [answer for answer in solved if answer.chain.name == name]
               for name in changed}
    return replace(simulation, laws=tuple(
        extended_law(law, answers[name]) if name in changed else law
        for name, law in zip(names, simulation.laws, strict=True)))
