"""Terms of the noise as readings show them: which are off by themselves, what errors remember.

Beside what a model misses, a reading may be off by itself, as a slip of the pen is, and an error
may remember the one before. Each is weighed as any cause is: by how probable it makes what several
models miss. Rivals of such noise are misfits of no cause: smooth in voltage, mass and specimen, or
with a jump. Noise that is less probable than a rival is not taken for noise. Mixtures of good and
bad readings: Hogg, Bovy, Lang, arXiv:1008.4686 (2010).
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
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.estimation.noise import Noise, NoiseMemory, NoiseTerm, Off

#: Share of readings that are off by themselves, beforehand: careful hands write one in a hundred.
SLIPS = 0.01
#: Logarithm of the largest such error over the least, of which all magnitudes are as probable.
_MAGNITUDES = float(np.log(1e3))
#: Largest share of readings that may be off: with more, the others do not determine the curve.
_MOST = 0.2
#: Most readings that are tried as off, those that are missed most. A bound of the cost.
_CANDIDATES = 200
#: Readings taken without gain after which no more are tried: two may hide each other.
_PATIENT = 4

#: Correlations of the errors of neighbouring readings that are tried.
CORRELATIONS = (0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
#: Shares of the variance that remember which are tried.
SHARES = (1.0, 0.5)

#: Largest ratio of errors that remember to the stated noise: people state by how much the next
#: reading differs, which for a correlation of 0.9 is half of the whole error.
LOUDER = 2.0

#: Largest ratio of errors that remember to the scatter of neighbours, where no noise is stated. A
#: sensor may wander by more between successive ramps than from reading to reading, but its owner
#: knows.
WANDERS = 3.0

#: Fewest readings before and after a jump: fewer are off by themselves, as slips of the pen are.
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
class Smooth:
    """Misfit that is a random sum of ``columns``, (n, columns), of any size."""

    columns: Array

    def value(self, model: Missed, noise: Noise, stated: float) -> float:
        """Logarithm of how probable what is missed is with such a misfit, as an error in common."""
        basis = orthonormal(noise.whitened(model.jacobian))
        columns = without(basis, noise.whitened(self.columns))
        rest = without(basis, noise.whitened(model.residual))
        directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
        sizes = sizes / max(sizes.max(initial=0.0), 1e-300)
        parts, squares = (directions.T @ rest) ** 2, float(rest @ rest)
        return _of_any_size(parts, sizes, squares, basis.shape[1], len(rest), stated)


@dataclass(frozen=True, eq=False)
class Jump:
    """Misfit that is one of some ``columns``, (n, columns), of any size, whichever it is.

    Of a few readings it is none: these are off by themselves.
    """

    columns: Array

    def value(self, model: Missed, noise: Noise, stated: float) -> float:
        """Logarithm of how probable what is missed is with such a misfit."""
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
    """Whether the same readings are off, and errors remember as much."""
    return list(map(_meaning, terms)) == list(map(_meaning, others))


def _meaning(term: NoiseTerm) -> tuple[object, ...]:
    if isinstance(term, NoiseMemory):
        return (NoiseMemory, term.correlation, *term.share.tolist())
    return (type(term), *term.rows.tolist())


def remembers(terms: Sequence[NoiseTerm]) -> bool:
    """Whether some errors remember those before."""
    return any(isinstance(term, NoiseMemory) for term in terms)


def noise_terms(noise: Noise, models: Sequence[Missed],
                rivals: Callable[[], Iterable[Smooth | Jump]] = tuple,
                chain: NoiseMemory | None = None, most: float = np.inf) -> tuple[NoiseTerm, ...]:
    """Terms that make the residuals of some models most probable; none if ``noise`` is enough.

    Parameters
    ----------
    models
        The nominal one first.
    rivals
        Misfits of the nominal model that are no noise.
    chain
        Readings whose errors may remember, a step of the clock apart.
    most
        Largest ratio of errors that remember to those of neighbours apart, where no noise is known
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
        # Errors that remember must do better than readings that are off do alone.
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
        # An effect must be as much more probable than errors that remember, beside fewer effects.
        best, value = alone, alone.value + _BETTER
        if value < plain.max() - _BETTER:
            return ()
    if any(rival.value(models[0], noise, stated) > value for rival in rivals()):
        return ()
    return best.terms


@dataclass(frozen=True)
class _Trial:
    """Terms that are tried, and the logarithm of how probable they make what is missed."""

    value: float = -np.inf
    terms: tuple[NoiseTerm, ...] = ()


def _over_neighbours(correlation: float, share: float) -> float:
    """Errors of readings over those by which neighbours are apart, over √2."""
    return float((1 - share * correlation) ** -0.5)


def probability_off(size: Array) -> Array:
    """Probability that readings are off by themselves, by what is missed over the noise."""
    odds = np.log(SLIPS / (1 - SLIPS)) + _slip_density(size) + 0.5 * size**2
    return np.asarray(expit(odds))


def chain_of(table: ReadingTable) -> NoiseMemory:
    """Readings of lengths at rest as they were made, a step of the clock from one to the next.

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
    return NoiseMemory(rows, run, clock, np.ones(len(rows)))


def _rest(residual: Array, jacobian: Array) -> tuple[float, int]:
    """Squares that are left beside unknowns, and how many of these readings determine."""
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
                  ) -> tuple[Off, float, float]:
    """Errors of single readings, and how probable these make all readings.

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
    rows = np.flatnonzero(off)
    return Off(rows, off[rows]), best_value, size


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
