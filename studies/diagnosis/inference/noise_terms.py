"""Terms of the noise that readings show: outliers, and correlated errors.

Besides the misfit of a model, a reading may be an outlier, such as a transcription error, and an
error may be correlated with the one before. Each is weighed as any cause is: by how probable it
makes the residuals of several models. Its rivals are misfits of no cause: smooth in voltage, mass
and specimen, or with a jump. Noise that is less probable than a rival is not taken as noise.
Mixtures of good and bad readings: Hogg, Bovy, Lang, arXiv:1008.4686 (2010).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from operator import attrgetter

import numpy as np
from scipy.special import expit

from tympan.base.arrays import Array
from tympan.studies.diagnosis.inference.projection import RANK, orthonormal, without
from tympan.studies.diagnosis.inference.weighing import NOISE, unlikely
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.estimation.noise import Noise, NoiseMemory, NoiseTerm, Off

#: Prior share of outliers: a careful person writes one wrong reading in a hundred.
SLIPS = 0.01
#: Log ratio of the largest to the least outlier; magnitudes between have a log-uniform prior.
_MAGNITUDES = float(np.log(1e3))
#: Largest share of outliers: with more, the other readings do not determine the curve.
_MOST = 0.2
#: Most readings that are tried as outliers, those with the largest residuals. It limits the cost.
_CANDIDATES = 200
#: Readings tried without gain after which the search ends: two may hide each other.
_PATIENT = 4

#: Trial values of the correlation of neighbouring errors.
CORRELATIONS = (0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
#: Trial values of the share of the variance that is correlated.
SHARES = (1.0, 0.5)

#: Largest ratio of correlated errors to the stated noise: people state by how much the next reading
#: differs, which for a correlation of 0.9 is half of the whole error.
LOUDER = 2.0

#: Largest ratio of correlated errors to the scatter of neighbours, where no noise is stated. A
#: sensor may drift by more between successive ramps than from reading to reading, but then its
#: owner knows.
WANDERS = 3.0

#: Fewest readings before and after a jump: fewer are outliers, such as transcription errors.
_FEW = 4

#: Trial sizes of misfits: root of the sum of squares, over the noise.
_SMOOTH = np.geomspace(1.0, 1e4, 9)

#: Number of models, those with the smallest misfit, for which readings are removed. It limits the
#: cost.
_MODELS = 8

#: Log ratio of probabilities from which another noise than the stated one is taken.
_BETTER = NOISE / 2


@dataclass(frozen=True, eq=False)
class Missed:
    """Residuals of a model, (n,), and their changes by its unknowns, (n, p).

    Both are in the readings' units.
    """

    residual: Array
    jacobian: Array


@dataclass(frozen=True, eq=False)
class Smooth:
    """Misfit that is a random sum of ``columns``, (n, columns), of any size."""

    columns: Array

    def value(self, model: Missed, noise: Noise, stated: float) -> float:
        """Compute the log probability of the residuals with such a misfit as a common error."""
        basis = orthonormal(noise.whitened(model.jacobian))
        columns = without(basis, noise.whitened(self.columns))
        rest = without(basis, noise.whitened(model.residual))
        directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
        sizes = sizes / max(sizes.max(initial=0.0), 1e-300)
        parts, squares = (directions.T @ rest) ** 2, float(rest @ rest)
        return _of_any_size(parts, sizes, squares, basis.shape[1], len(rest), stated)


@dataclass(frozen=True, eq=False)
class Jump:
    """Misfit that is any one of some ``columns``, (n, columns), of any size.

    A shift of only a few readings is no jump: those are outliers.
    """

    columns: Array

    def value(self, model: Missed, noise: Noise, stated: float) -> float:
        """Compute the log probability of the residuals with such a misfit."""
        jumps = noise.whitened(self.columns)
        rows = np.count_nonzero(jumps, axis=0)
        jumps = jumps[:, (rows >= _FEW) & (rows <= len(jumps) - _FEW)]
        basis = orthonormal(noise.whitened(model.jacobian))
        columns, rest = without(basis, jumps), without(basis, noise.whitened(model.residual))
        lengths = np.sum(columns**2, axis=0)
        columns, lengths = columns[:, lengths > RANK], lengths[lengths > RANK]
        if not len(lengths):
            return -np.inf
        part = np.max((columns.T @ rest) ** 2 / lengths, keepdims=True)
        return _of_any_size(part, np.ones(1), float(rest @ rest), basis.shape[1], len(rest),
                            stated) - float(np.log(len(lengths)))


def same_terms(terms: Sequence[NoiseTerm], others: Sequence[NoiseTerm]) -> bool:
    """Check whether both have the same outliers and the same correlation of errors."""
    return list(map(_meaning, terms)) == list(map(_meaning, others))


def _meaning(term: NoiseTerm) -> tuple[object, ...]:
    if isinstance(term, NoiseMemory):
        return (NoiseMemory, term.correlation, *term.share.tolist())
    return (type(term), *term.rows.tolist())


def remembers(terms: Sequence[NoiseTerm]) -> bool:
    """Check whether some errors are correlated with those before."""
    return any(isinstance(term, NoiseMemory) for term in terms)


def noise_terms(noise: Noise, models: Sequence[Missed],
                rivals: Callable[[], Iterable[Smooth | Jump]] = tuple,
                chain: NoiseMemory | None = None, most: float = np.inf) -> tuple[NoiseTerm, ...]:
    """Find the terms that make the residuals of models most probable; none if ``noise`` is enough.

    Parameters
    ----------
    models
        Models whose residuals are used, the nominal one first.
    rivals
        Misfits of the nominal model that are no noise.
    chain
        Readings whose errors may be correlated, with a step of the clock between neighbours.
    most
        Largest ratio of correlated errors to the scatter of neighbours, where no noise is known
        beforehand.
    """
    stated = float(noise.freedom.sum())
    steps = [(0.0, 1.0)]
    if chain is not None and len(chain.rows):
        steps += product(CORRELATIONS, SHARES)
    if not stated:
        steps = [step for step in steps if _over_neighbours(*step) <= most]
    plain = np.empty(len(models))
    best, alone = _Trial(), _Trial()
    for correlation, share in steps:
        trial = noise
        if chain is not None and correlation:
            trial = noise.plus(chain.of(correlation, share))
        # Correlated errors must be more probable than outliers alone.
        volume = trial.log_volume + (_BETTER if correlation else 0.0)
        white = [(trial.whitened(model.residual), trial.whitened(model.jacobian))
                 for model in models]
        values = np.array([_value(*_rest(*model), len(noise), stated) for model in white]) - volume
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
            memory = trial.terms[len(noise.terms):]
            reached = _Trial(value - volume, (*memory, *([off] if len(off.rows) else [])))
            best = max(best, reached, key=attrgetter("value"))
            if correlation and simpler[place] and reached.value >= plain[place]:
                alone = max(alone, reached, key=attrgetter("value"))
    value = best.value + (_BETTER if remembers(best.terms) else 0.0)
    if value < plain.max() + _BETTER:
        # An effect must beat correlated errors by as much, with fewer effects present.
        best, value = alone, alone.value + _BETTER
        if value < plain.max() - _BETTER:
            return ()
    if any(rival.value(models[0], noise, stated) > value for rival in rivals()):
        return ()
    return best.terms


@dataclass(frozen=True)
class _Trial:
    """Terms that are tried, and the log probability of the residuals with them."""

    value: float = -np.inf
    terms: tuple[NoiseTerm, ...] = ()


def _over_neighbours(correlation: float, share: float) -> float:
    """Compute the ratio of errors to the difference of neighbours over √2."""
    return float((1 - share * correlation) ** -0.5)


def probability_off(size: Array) -> Array:
    """Compute the probability that readings are outliers, from residuals over noise."""
    odds = np.log(SLIPS / (1 - SLIPS)) + _slip_density(size) + 0.5 * size**2
    return np.asarray(expit(odds))


def chain_of(table: ReadingTable) -> NoiseMemory:
    """Chain static readings of lengths in the order they were made, with their clock steps.

    The order is the written one, else that of the lines of each ramp; steps are those of the clock
    where it follows that order.
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
    return NoiseMemory(rows, run, clock, np.ones(len(rows)))


def _rest(residual: Array, jacobian: Array) -> tuple[float, int]:
    """Compute the squares left after fitting unknowns, and the number of unknowns determined."""
    basis = orthonormal(jacobian)
    rest = without(basis, residual)
    return float(rest @ rest), basis.shape[1]


def _value(squares: float, unknowns: int, count: int, stated: float) -> float:
    """Compute the log probability of ``count`` good readings besides some unknowns."""
    return -0.5 * unlikely(squares, count, stated, unknowns)


def _slip(size: float) -> float:
    """Compute the log probability of an outlier by its size over the noise.

    It is relative to the constants left out for a good reading.
    """
    return float(np.log(SLIPS) + _slip_density(np.array(size)) + 0.5)


def _slip_density(size: Array) -> Array:
    """Compute the log density of outliers by their size, over that of noise at 0."""
    return np.asarray(0.5 * np.log(2 * np.pi)
                      - np.log(2 * _MAGNITUDES * np.maximum(np.abs(size), 1.0)))


def _readings_off(residual: Array, jacobian: Array, noise: Noise, stated: float
                  ) -> tuple[Off, float, float]:
    """Find outliers and the log probability of all readings with them.

    Return also the size of the other errors over the noise.
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
    rows = np.flatnonzero(off)
    return Off(rows, off[rows]), best_value, size


def _largest(rest: Array, columns: Array) -> Iterator[tuple[int, float, float]]:
    """Yield the columns that reduce the residuals most, in turn: number, squares left, size."""
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


def _of_any_size(parts: Array, sizes: Array, squares: float, unknowns: int, count: int,
                 stated: float) -> float:
    """Compute the log probability of ``squares`` with a misfit of any size besides unknowns.

    ``parts``: squares along the directions of the misfit; ``sizes``: sizes of these directions,
    over the largest.
    """
    values = []
    for size in _SMOOTH.tolist():
        wider = 1 + (size * sizes) ** 2
        left = max(squares - float(np.sum(parts * (1 - 1 / wider))), 0.0)
        values.append(_value(left, unknowns + 1, count, stated)
                      - 0.5 * float(np.log(wider).sum()))
    return max(values)
