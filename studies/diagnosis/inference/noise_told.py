"""Noise as readings show it: which are off by themselves, and what errors remember.

Beside what a model misses, a reading may be off by itself, as a slip of the pen is, and an error
may remember the one before. Each is weighed as any cause is: by how probable it makes what several
models miss. A misfit that is smooth in voltage, mass and specimen is one of the models, and so is
one that jumps once, so that neither is taken for noise. Mixtures of good and bad readings: Hogg,
Bovy, Lang, arXiv:1008.4686 (2010).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from operator import itemgetter

import numpy as np
from scipy.special import expit

from tympan.base.arrays import Array, Mask
from tympan.studies.diagnosis.inference.projection import RANK, orthonormal, without
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.estimation.noise import Memory, Noise

#: Share of readings that are off by themselves, beforehand: careful hands write one in a hundred.
SLIPS = 0.01
#: Logarithm of the largest such error over the least, of which all magnitudes are as probable.
_MAGNITUDES = float(np.log(1e3))
#: Most readings that are off, as a share: of more, the others do not tell how.
_MOST = 0.2
#: Most that are tried, of those that are missed most. A bound of the cost.
_CANDIDATES = 200
#: Readings taken without gain after which no more are tried: two may hide each other.
_PATIENT = 4

#: Correlations that are tried, of what neighbouring readings' errors remember.
CORRELATIONS = (0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
#: Shares of the variance that remember, that are tried.
SHARES = (1.0, 0.5)

#: Most that errors which remember may exceed what is stated: people state what the next reading
#: differs by, which for a correlation of 0.9 is a half of all.
LOUDER = 2.0

#: The same over the scatter of neighbours, where nothing is stated: a sensor whose error wanders by
#: more between successive ramps than from reading to reading is possible, but its owner knows.
WANDERS = 3.0

#: Fewest readings of a jump, and beside it: fewer are off by themselves, as slips of the pen are.
_FEW = 4

#: Sizes of misfits that are tried: the root of all their squares, over the noise.
_SMOOTH = np.geomspace(1.0, 1e4, 9)

#: Models for which readings are taken away, those that are missed least. A bound of the cost.
_MODELS = 8

#: Logarithm of how much more probable readings must be for another noise than is stated: 20 to 1.
_BETTER = 3.0


@dataclass(frozen=True, eq=False)
class Missed:
    """Residuals of a model, (n,), and what its unknowns could change, (n, p).

    Both in the readings' units.
    """

    residual: Array
    jacobian: Array


@dataclass(frozen=True, eq=False)
class Told:
    """Noise as readings show it, beside what is stated.

    ``correlation`` of what the errors of neighbours remember in ``chain``, readings in the order in
    which they may, a step apart, None where they do not; ``share`` of the variance that does;
    ``off``: how far readings are off by themselves, (n,) [their units], 0 where not; ``own``: what
    their own noise is of that, (n,).
    """

    off: Array
    own: Array
    correlation: float = 0.0
    share: float = 1.0
    chain: Memory | None = None

    @classmethod
    def nothing(cls, count: int) -> Told:
        """Nothing beside what is stated, of so many readings."""
        return cls(np.zeros(count), np.ones(count))

    def of(self, noise: Noise) -> Noise:
        """A noise with it."""
        if self.chain is not None and self.correlation:
            clock = -np.log(self.correlation) * self.chain.clock
            share = np.full(len(noise), self.share)
            noise = replace(noise, memory=replace(self.chain, clock=clock, share=share))
        return noise.with_off(self.off) if self.off.any() else noise

    def __getitem__(self, rows: Mask) -> Told:
        """Part for some readings."""
        return replace(self, off=self.off[rows], own=self.own[rows],
                       chain=self.chain and self.chain[rows])

    def alike(self, other: Told) -> bool:
        """Whether the same readings are off, and errors remember as much."""
        return bool((self.correlation, self.share) == (other.correlation, other.share)
                    and np.array_equal(self.off > 0, other.off > 0))

    @property
    def anything(self) -> bool:
        """Whether the noise is another than stated."""
        return bool(self.correlation or self.off.any())


def noise_told(noise: Noise, models: Sequence[Missed], smooth: Callable[[], Iterable[Array]],
               chain: Memory | None = None, jumps: Sequence[Array] = (), most: float = np.inf
               ) -> Told:
    """Noise that makes the residuals of some models most probable; nothing if it is as stated.

    ``models``: the nominal one first; ``smooth`` answers columns of which what else it may miss is
    a random sum, (n, columns), of one kind of misfit after the other; ``jumps``: columns of which
    it may miss one, whichever it is. ``most``: errors that remember over those of neighbours
    apart, at most, where no noise is known beforehand.
    """
    count, stated, nothing = len(noise), float(noise.freedom.sum()), Told.nothing(len(noise))
    remembers = chain is not None and np.any(chain.run >= 0)
    steps = [(0.0, 1.0), *(product(CORRELATIONS, SHARES) if remembers else ())]
    if not stated:
        steps = [step for step in steps if _over_neighbours(*step) <= most]
    plain = np.empty(len(models))
    best, alone = (-np.inf, nothing), (-np.inf, nothing)
    for correlation, share in steps:
        trial = replace(nothing, correlation=correlation, share=share, chain=chain).of(noise)
        # Errors that remember must do better than readings that are off do alone.
        volume = trial.log_volume + (_BETTER if correlation else 0.0)
        white = [(trial.whitened(model.residual), trial.whitened(model.jacobian))
                 for model in models]
        values = np.array([_value(*_rest(*model), count, stated) for model in white]) - volume
        if not correlation:
            plain = values
            unknowns = np.array([model.jacobian.shape[1] for model in models])
            simpler = unknowns < unknowns[int(plain.argmax())]
        order = np.argsort(-values, kind="stable")[:_MODELS].tolist()
        for place in dict.fromkeys([0, *order]):
            residual, jacobian = white[place]
            off, value, size = _readings_off(residual, jacobian, trial, stated)
            if correlation and stated and size > LOUDER:
                continue
            reached = (value - volume, Told(off, noise.sigma / np.hypot(noise.sigma, off),
                                            correlation, share, chain if correlation else None))
            best = max(best, reached, key=itemgetter(0))
            if correlation and simpler[place] and reached[0] >= plain[place]:
                alone = max(alone, reached, key=itemgetter(0))
    value, told = best
    value += _BETTER if told.correlation else 0.0
    if value < plain.max() + _BETTER:
        # An effect must be as much more probable than errors that remember, beside fewer effects.
        value, told = alone[0] + _BETTER, alone[1]
        if value < plain.max() - _BETTER:
            return nothing
    residual, jacobian = (noise.whitened(part)
                          for part in (models[0].residual, models[0].jacobian))
    if (any(_jump_value(residual, jacobian, noise.whitened(columns), stated) > value
            for columns in jumps)
            or any(_smooth_value(residual, jacobian, noise.whitened(columns), stated) > value
                   for columns in smooth())):
        return nothing
    return told


def _over_neighbours(correlation: float, share: float) -> float:
    """Errors of readings over those by which neighbours are apart, over √2."""
    return float((1 - share * correlation) ** -0.5)


def probability_off(size: Array) -> Array:
    """Probability that readings are off by themselves, by what is missed over the noise."""
    odds = np.log(SLIPS / (1 - SLIPS)) + _slip_density(size) + 0.5 * size**2
    return np.asarray(expit(odds))


def chain_of(table: ReadingTable) -> Memory:
    """Readings of lengths at rest as they were made, a step from one to the next.

    By the order that is written, else by the lines of each ramp; by the clock where that runs
    along.
    """
    resting = table.lengths & (table.point < 0) & ~np.isin(table.state, table.states.in_time)
    rows = np.flatnonzero(resting)
    order = table.order[rows]
    ordered = len(np.unique(order[np.isfinite(order)])) == len(rows)
    run = np.zeros(len(rows), np.int64) if ordered else table.ramp[rows]
    turn = np.lexsort((order if ordered else table.line[rows], run))
    rows, run = rows[turn], run[turn]
    clock = np.arange(len(rows), dtype=float)
    elapsed = table.states.elapsed[table.state[rows]]
    if len(rows) > 1 and np.all(np.diff(elapsed) > 0):
        clock = elapsed / float(np.median(np.diff(elapsed)))
    chain = Memory.none(len(table))
    chain.run[rows], chain.clock[rows] = run, clock
    return chain


def _rest(residual: Array, jacobian: Array) -> tuple[float, int]:
    """Squares that are left beside unknowns, and how many of these are told."""
    basis = orthonormal(jacobian)
    rest = without(basis, residual)
    return float(rest @ rest), basis.shape[1]


def _value(squares: float, unknowns: int, count: int, stated: float) -> float:
    """Logarithm of how probable so many good readings are, whatever a factor on their noise is.

    Schwarz' penalty for each unknown; the constants of a normal distribution are left out.
    """
    freedom = count + stated
    return (-0.5 * freedom * float(np.log(max(squares + stated, 1e-12) / freedom))
            - 0.5 * unknowns * float(np.log(max(count, 2))))


def _slip(size: float) -> float:
    """Logarithm of how probable a reading is that is off, by its size over the noise.

    Over that of the constants left out of a good one's.
    """
    return float(np.log(SLIPS) + _slip_density(np.array(size)) + 0.5)


def _slip_density(size: Array) -> Array:
    """Logarithm of the density of slips by their size, over that of noise at 0."""
    return np.asarray(0.5 * np.log(2 * np.pi)
                      - np.log(2 * _MAGNITUDES * np.maximum(np.abs(size), 1.0)))


def _readings_off(residual: Array, jacobian: Array, noise: Noise, stated: float
                  ) -> tuple[Array, float, float]:
    """Errors of single readings [their units], and how probable these make all of them.

    And the size of the others' errors over the noise.
    """
    count = len(residual)
    basis = orthonormal(jacobian)
    rest = without(basis, residual)
    likely = np.argsort(-np.abs(rest), kind="stable")[:_CANDIDATES]
    one = np.zeros((count, len(likely)))
    one[likely, np.arange(len(likely))] = noise.sigma[likely]
    columns = without(basis, noise.whitened(one))
    best_value = _value(float(rest @ rest), basis.shape[1], count, stated)
    chosen, best, value, most = list[int](), list[int](), 0.0, float(rest @ rest)
    for number, left, size in _largest(rest, columns):
        chosen.append(number)
        value += _slip(size)
        reached = _value(left, basis.shape[1], count - len(chosen), stated) + value
        if reached > best_value:
            best, best_value, most = [*chosen], reached, left
        if len(chosen) >= max(1, int(_MOST * count)) or len(chosen) - len(best) >= _PATIENT:
            break
    off = np.zeros(count)
    if best:
        sizes = np.linalg.lstsq(columns[:, best], rest, rcond=None)[0]
        off[likely[best]] = np.abs(sizes) * noise.sigma[likely[best]]
    size = ((most + stated) / (count - len(best) + stated)) ** 0.5
    return off, best_value, size


def _largest(rest: Array, columns: Array) -> Iterator[tuple[int, float, float]]:
    """Columns that take most of what is left away, one by one: number, squares left, size."""
    for _ in range(columns.shape[1]):
        lengths = np.sum(columns**2, axis=0)
        parts = columns.T @ rest
        shares = np.where(lengths > RANK, parts**2 / np.maximum(lengths, RANK), 0.0)
        best = int(shares.argmax())
        if shares[best] <= 0:
            return
        unit = columns[:, best] / lengths[best] ** 0.5
        rest = rest - unit * (unit @ rest)
        yield best, float(rest @ rest), float(parts[best] / lengths[best])
        columns = columns - np.outer(unit, unit @ columns)


def _smooth_value(residual: Array, jacobian: Array, smooth: Array, stated: float) -> float:
    """Probability of what is missed with a smooth misfit of any size, as an error in common."""
    basis = orthonormal(jacobian)
    columns, rest = without(basis, smooth), without(basis, residual)
    directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    sizes = sizes / max(sizes.max(initial=0.0), 1e-300)
    parts, squares = (directions.T @ rest) ** 2, float(rest @ rest)
    return _of_any_size(parts, sizes, squares, basis.shape[1], len(rest), stated)


def _jump_value(residual: Array, jacobian: Array, jumps: Array, stated: float) -> float:
    """The same with one jump of any size, each as probable as the others.

    One of a few readings is none: these are off by themselves.
    """
    rows = np.count_nonzero(jumps, axis=0)
    jumps = jumps[:, (rows >= _FEW) & (rows <= len(jumps) - _FEW)]
    basis = orthonormal(jacobian)
    columns, rest = without(basis, jumps), without(basis, residual)
    lengths = np.sum(columns**2, axis=0)
    columns, lengths = columns[:, lengths > RANK], lengths[lengths > RANK]
    if not len(lengths):
        return -np.inf
    part = np.max((columns.T @ rest) ** 2 / lengths, keepdims=True)
    return _of_any_size(part, np.ones(1), float(rest @ rest), basis.shape[1], len(rest),
                        stated) - float(np.log(len(lengths)))


def _of_any_size(parts: Array, sizes: Array, squares: float, unknowns: int, count: int,
                 stated: float) -> float:
    """Probability of ``squares`` with a misfit of any size beside unknowns.

    ``parts`` of the squares are along its directions, ``sizes`` those of its directions, over the
    largest.
    """
    values = []
    for size in _SMOOTH.tolist():
        wider = 1 + (size * sizes) ** 2
        left = max(squares - float(np.sum(parts * (1 - 1 / wider))), 0.0)
        values.append(_value(left, unknowns + 1, count, stated)
                      - 0.5 * float(np.log(wider).sum()))
    return max(values)
