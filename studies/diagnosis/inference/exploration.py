"""Exploration: hypotheses fitted over their physical range, with the reduced model grown for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.diagnosis.evidence.kind import ReadingModel
from tympan.studies.diagnosis.fits.fit import Fit, best_of
from tympan.studies.diagnosis.fits.fitting import fit, with_sizes
from tympan.studies.diagnosis.hypothesis import (
    FACTORS,
    SIZES,
    Cause,
    Hypothesis,
    hypotheses_of,
    parameter_at,
    parameters_of,
    sizes_of,
)
from tympan.studies.diagnosis.inference.projection import basis_outside, taken_by
from tympan.studies.diagnosis.reading_table import ReadingTable

#: Size of an effect at which a further search starts, as a share of the sampled range: near its
#: end, not on it.
_SHARE = 0.9
#: Largest size over the prior scale at which a further search starts. A start further out does not
#: help. Set by trial.
_USUAL = 8.0

#: Starting sizes over the prior scale of effects whose parameters do not act additively.
_TOGETHER = 1.5 * np.array([-1.0, 0.0, 1.0])

#: Factor on the decrease of the cost that derivatives promise beyond the sampled range: films
#: harden, so it may be more. Set by trial.
_PROMISE = 3.0
#: Distance in cost from the best fit up to which an effect is grown: for odds of exp(-15) no new
#: film is solved.
_BEHIND = 15.0

#: Distance in log probability from the best fit up to which a fit is made exact: exp(-6) is a
#: quarter of a per cent.
_NEAR = 6.0
#: Most fits that are made exact. It limits the cost.
_MOST = 4
#: Size over the prior scale below which an effect is left out where films are made exact: there
#: force laws are accurate.
_ACTIVE = 0.2
#: Rounds in which fits are made exact: each time they move a little.
_ROUNDS = 3

#: Factor on the improvement that derivatives promise from a second effect.
_HELP = 1.5

#: Number of single effects that are tried far beyond their best fit where none explains the
#: readings. It limits the cost.
_VENTURES = 3
#: Times that an effect is grown beyond its best fit. It limits the cost.
_STEPS = 4
#: χ² by which an effect may be behind the best one and still rival it once it is exact. Set by
#: trial.
_RIVAL = 30.0

#: Decrease of the logarithm of a hypothesis' prior probability for each of its effects.
COUNT = 3.0


#: Size at which effects are tried together, over the prior scale.
_FIRST = 1.3

#: Most times that effects are grown, alone and in pairs. It limits the cost.
_GROWTHS = (40, 12)
#: Distance from a limit, as a share of it, at which a fit lies on it: searches end a little before.
_AT = 1e-3


@dataclass
class Exploration:
    """Fits of hypotheses of one or two causes to a table, and the simulation grown for them.

    ``adequate`` checks whether the residuals of a fit may be noise; ``widen``: a factor on prior
    scales; ``workers``: processes for new films.
    """

    simulation: ReadingModel
    table: ReadingTable
    nominal: Fit
    causes: Sequence[Cause]
    adequate: Callable[[Fit], bool]
    widen: float = 1.0
    workers: int = 1
    fits: dict[Hypothesis, Fit] = field(default_factory=dict)

    def run(self) -> None:
        """Fit every cause alone, and every pair that may help."""
        singles: list[Hypothesis] = [(cause,) for cause in self.causes]
        pairs = hypotheses_of(self.causes)[len(singles) :]
        for single in singles:
            self._fit(single, self._starts(single))
        self._reach()
        self._grow(singles, _GROWTHS[0])
        # Before pairs, since a second effect may compensate the error of a force law.
        self._refine(_BEHIND)
        if not self._explained():
            self._venture(self.ranked()[:_VENTURES])
            self._refine(_BEHIND)
        for pair in pairs:
            if starts := pair_starts(pair, self.fits, self._least, self.simulation, self.table):
                self._fit(pair, starts)
        self._refine(_NEAR)
        if not self._explained():
            self._grow([pair for pair in pairs if pair in self.fits], _GROWTHS[1])
            self._alone_again()
            self._refine(_NEAR)
        if not self._explained():
            self._join(pairs)
            self._grow([pair for pair in pairs if pair in self.fits], _GROWTHS[1])
            self._refine(_NEAR)
        if self._explained():
            self._venture(self._contenders())
            self._refine(_NEAR)

    def ranked(self) -> list[Fit]:
        """List fits that are possible and at a minimum, most probable first."""
        return sorted((fit for fit in self.fits.values() if np.isfinite(fit.evidence)),
                      key=lambda fit: -self._log(fit))

    def alone(self, factor: float) -> list[Fit]:
        """Fit every effect alone, with prior scales multiplied by ``factor``."""
        again = [fit(self.simulation, before.hypothesis, self.table, before.unknowns,
                     factor * self.widen)
                 for before in self.fits.values() if len(before.hypothesis) == 1]
        return [fit for fit in again if fit.possible]

    @property
    def _least(self) -> float:
        return min((fit.cost for fit in self.fits.values()), default=np.inf)

    def _starts(self, hypothesis: Hypothesis) -> list[Array]:
        """List starts of a search: without effect, and with each parameter large to either side.

        Where the sign changes nothing a search cannot leave 0. Parameters that do not act
        additively are also started together.
        """
        bounds = self.simulation.bounds(hypothesis)
        none = np.zeros(bounds.shape[1])
        none[: len(self.nominal.unknowns)] = self.nominal.unknowns
        parameters = parameters_of(hypothesis)
        even = all(item.sign == "even" or item.spread for item in parameters)
        if even and any(item.spread for item in parameters):
            ends = [(0.0,) if item.spread else item.deviation * _TOGETHER for item in parameters]
            return [np.r_[none[: SIZES.start], way] for way in product(*ends) if any(way)]
        starts = [none]
        for number, parameter in enumerate(parameters, SIZES.start):
            for bound in () if parameter.switch else bounds[:, number]:
                size = np.sign(bound) * _SHARE * min(abs(bound), _USUAL * parameter.deviation)
                if size:
                    starts.append(none.copy())
                    starts[-1][number] = size
        return starts[1:] if even else starts

    def _fit(self, hypothesis: Hypothesis, starts: Sequence[Array]) -> None:
        fits = [fit(self.simulation, hypothesis, self.table, start, self.widen)
                for start in starts]
        self.fits[hypothesis] = best_of(fits)

    def _join(self, pairs: Sequence[Hypothesis]) -> None:
        """Fit pairs in which each effect hides or changes what the other does."""
        usual = [_usual(self.nominal, pair) for pair in pairs]
        self.simulation = self.simulation.coupled(pairs, usual, self.workers)
        taken, promises = taken_by(self.nominal.free_jacobian), []
        for pair, corner in zip(pairs, usual, strict=True):
            bounds = self.simulation.bounds(pair)
            corners = [np.clip(corner * np.r_[1, 1, signs], *bounds)
                       for signs in product((1, -1), repeat=len(corner) - SIZES.start)]
            shown = np.array([self._shown(pair, unknowns) for unknowns in corners])
            shown -= self._shown((), self.nominal.unknowns)
            more = basis_outside(taken, shown.T)
            cost = self.nominal.cost - 0.5 * float(np.sum((more.T @ self.nominal.residual) ** 2))
            promises.append((cost, pair, corners))
        for cost, pair, corners in sorted(promises, key=lambda promise: promise[0]):
            if cost < self._least + _BEHIND:
                before = self.fits.get(pair)
                self._fit(pair, [*corners, *([before.unknowns] if before else [])])

    def _shown(self, hypothesis: Hypothesis, unknowns: Array) -> Array:
        """Predict readings, over their noise."""
        shown = self.simulation.prediction(hypothesis, unknowns, self.table)
        return self.table.noise.whitened(shown.extended)

    def _reach(self) -> None:
        """Extend force laws to larger deflections and voltages, where one effect may need them."""
        short = [fit.hypothesis for fit in self.fits.values()
                 if not fit.possible and fit.short < self._least + _BEHIND]
        if short:
            self.simulation = self.simulation.further(self.workers)
            for hypothesis in short:
                self._fit(hypothesis, [self.fits[hypothesis].unknowns, *self._starts(hypothesis)])

    def _explained(self) -> bool:
        return any(map(self.adequate, self.ranked()[:_MOST]))

    def _contenders(self) -> list[Fit]:
        """List other single effects that may come as near the readings as the most probable fit."""
        best = self.ranked()[0]
        return [fit for fit in self.ranked()
                if len(fit.hypothesis) == 1 and fit.hypothesis[0] not in best.hypothesis
                and fit.chi_squared < best.chi_squared + _RIVAL]

    def _venture(self, fits: Sequence[Fit]) -> None:
        """Search other minima of single effects far beyond those found, and make them exact."""
        for before in fits:
            for number in range(SIZES.start, len(before.unknowns)):
                side = 1 if before.unknowns[number] > 0 else -1
                cause, index = parameter_at(before.hypothesis, number)
                for _ in range(_STEPS):
                    simulation = self.simulation.grown(cause, index, side, self.workers)
                    if simulation is self.simulation:
                        break
                    self.simulation = simulation
                    bounds = simulation.bounds(before.hypothesis)
                    further = self.fits[before.hypothesis].unknowns.copy()
                    further[number] = _SHARE * bounds[0 if side < 0 else 1, number]
                    self._fit(before.hypothesis, [self.fits[before.hypothesis].unknowns, further])
            self._solve_at(before.hypothesis)

    def _alone_again(self) -> None:
        """Fit the members of the best pairs alone, starting at their sizes in the pair."""
        for best in self.ranked()[:_MOST]:
            for cause in best.hypothesis if len(best.hypothesis) > 1 else ():
                sizes = best.unknowns[sizes_of(best.hypothesis, cause)]
                start = np.concatenate([best.unknowns[FACTORS], sizes])
                self._fit((cause.first,), [self.fits[cause.first,].unknowns, start])

    def _grow(self, hypotheses: Sequence[Hypothesis], most: int) -> None:
        """Grow the effects stopped at the end of the sampled range, most promising first."""
        ended: set[tuple[Hypothesis, int]] = set()
        for _ in range(most):
            pressing = [(cost, hypothesis, number) for hypothesis in hypotheses
                        for cost, number in self._pressing(self.fits[hypothesis])
                        if cost < self._least + _BEHIND and (hypothesis, number) not in ended]
            if not pressing:
                return
            _, hypothesis, number = min(pressing, key=lambda item: item[0])
            before = self.fits[hypothesis]
            side = 1 if before.unknowns[number] > 0 else -1
            end = (0 if side < 0 else 1), number
            if abs(self.simulation.bounds(hypothesis)[end]) <= abs(before.bounds[end]):
                cause, index = parameter_at(hypothesis, number)
                self.simulation = self.simulation.grown(cause, index, side, self.workers)
            bound = self.simulation.bounds(hypothesis)[end]
            if abs(bound) <= abs(before.bounds[end]):
                ended.add((hypothesis, number))
                continue
            further = before.unknowns.copy()
            further[number] = _SHARE * bound
            self._fit(hypothesis, [before.unknowns, further])

    def _pressing(self, fit: Fit) -> Iterator[tuple[float, int]]:
        """Yield sizes at the end of the sampled range, and the costs they promise beyond it."""
        if not fit.possible:
            return
        limits, variance = self.simulation.limits(fit.hypothesis), np.diag(fit.covariance)
        for number in range(SIZES.start, len(fit.unknowns)):
            size, slope = fit.unknowns[number], fit.slope[number]
            for bound, limit in zip(fit.bounds[:, number], limits[:, number], strict=True):
                at_end = abs(size - bound) <= _AT * abs(bound) and size != 0
                if at_end and slope * bound < 0 and abs(bound) < (1 - _AT) * abs(limit):
                    yield fit.cost - _PROMISE * 0.5 * slope**2 * variance[number], number

    def _refine(self, near: float) -> None:
        """Make films exact at the most probable fits, until these stay where they were."""
        for _ in range(_ROUNDS):
            before = self.simulation
            for hypothesis in [fitted.hypothesis for fitted in self._near(near)]:
                self._solve_at(hypothesis)
            if self.simulation is before:
                return

    def _solve_at(self, hypothesis: Hypothesis) -> None:
        unknowns = self.fits[hypothesis].unknowns
        usual = np.array([item.deviation for item in parameters_of(hypothesis)])
        active = unknowns.copy()
        active[SIZES] *= np.abs(unknowns[SIZES]) >= _ACTIVE * usual
        simulation = self.simulation.refined(hypothesis, active, self.workers)
        if simulation is not self.simulation:
            self.simulation = simulation
            self._fit(hypothesis, [unknowns])

    def _near(self, near: float) -> list[Fit]:
        ranked = self.ranked()
        return [fit for fit in ranked[:_MOST] if self._log(fit) > self._log(ranked[0]) - near]

    def _log(self, fit: Fit) -> float:
        """Compute the logarithm of evidence and prior, without the count of such hypotheses."""
        return fit.evidence - COUNT * len(fit.hypothesis)


def pair_starts(pair: Hypothesis, fits: Mapping[Hypothesis, Fit], least: float,
                simulation: ReadingModel, table: ReadingTable) -> list[Array]:
    """List starts of a fit of two effects: each single fit that the other may improve enough.

    ``fits``: of both alone; ``least``: the cost that a fit must not be far behind. A repeated
    effect begins without size, at a time (or similar) one prior scale from that of the first.
    """
    def may_help(member: Fit, columns: Array) -> bool:
        more = basis_outside(taken_by(member.free_jacobian), columns)
        gain = 0.5 * float(np.sum((more.T @ member.residual) ** 2))
        return member.cost - _HELP * gain < least + _BEHIND

    first, second = (fits[cause.first,] for cause in pair)
    if not pair[1].again:
        return [with_sizes(pair, member) for member, other in ((first, second), (second, first))
                if member.possible and may_help(member, other.jacobian[:, SIZES])]
    starts, (low, high) = list[Array](), simulation.bounds(first.hypothesis)
    parameters = parameters_of(first.hypothesis)
    apart = np.array([item.spread for item in parameters])
    # In prior scales: readings say nothing about a single pascal.
    usual = np.array([item.deviation for item in parameters])
    for way in (-1, 1) if first.possible else ():
        unknowns = first.unknowns.copy()
        unknowns[SIZES] = np.where(apart, unknowns[SIZES] + way * apart, 0.0)
        unknowns = np.clip(unknowns, low, high)
        shown = simulation.prediction(first.hypothesis, unknowns, table)
        if may_help(first, usual * table.noise.whitened(shown.jacobian)[:, SIZES]):
            starts.append(np.r_[first.unknowns, unknowns[SIZES]])
    return starts


def _usual(nominal: Fit, hypothesis: Hypothesis) -> Array:
    """Build unknowns with effects of about their prior scales."""
    sizes = [_FIRST * parameter.deviation for parameter in parameters_of(hypothesis)]
    return np.concatenate([nominal.unknowns, sizes])
