"""Where residuals have structure: tests with smooth columns by voltage, mass, specimen and time.

Noise is rough: what is smooth along a ramp is not noise. So the scatter about smooth curves
measures the noise whether or not the one stated is right, and what the smooth curves take from the
residuals is what the simulation gets wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from tympan.studies.diagnosis.reading_table import ReadingTable

Array = NDArray[np.float64]

_DEGREE = 4
_RANK = 1e-6
_DRAWS = 4000

#: Degrees of freedom a stated noise counts as: it is taken to be right within about a quarter.
STATED = 8.0
#: Probability below which scatter beyond the stated noise is no noise: what no curve here follows
#: may be a misfit too.
_ROUGH = 1e-3


@dataclass(frozen=True, eq=False)
class ResidualPattern:
    """Columns a misfit may be a combination of, in units of the readings, and the words for it."""

    name: str
    words: str
    columns: Array


def patterns(table: ReadingTable, names: Sequence[str],
             predicted: Array) -> tuple[ResidualPattern, ...]:
    """The patterns of a table.

    ``names`` are its specimens', ``predicted`` what the nominal model says.
    """
    size = np.full(len(table), float(np.sqrt(np.mean(predicted**2))))
    voltage, mass = _voltage(table), _standard(table.mass)
    common = [ResidualPattern("level", "all readings are off by about the same length",
                      size[:, None] * voltage[:, :1]),
              ResidualPattern("voltage", "the way it depends on voltage is wrong",
                      size[:, None] * voltage[:, 1:])]
    shapes = [ResidualPattern(f"specimen {names[k]}",
                              f"{names[k]} is off against the other specimens",
                      (size * own)[:, None] * voltage[:, :3]) for k, own in _contrasts(table)]
    loads = [ResidualPattern("mass", "the way it depends on mass is wrong",
                     (size * mass)[:, None] * voltage[:, :3])]
    further = [ResidualPattern("fitted value", "large deflections are off against small ones",
                       np.stack([predicted, predicted * abs(predicted) / size.max()], 1))]
    found = [*common, *shapes, *loads, *_in_time(table, size, voltage), *further]
    whole = np.concatenate([pattern.columns for pattern in found] + [_ramps(table, size, voltage)],
                           axis=1)
    found.append(ResidualPattern("ramps", "single ramps are off in different ways", whole))
    return tuple(pattern for pattern in found if np.abs(pattern.columns).max(initial=0.0) > 0)


def _voltage(table: ReadingTable) -> Array:
    """Legendre polynomials in U², shape (rows, up to 5)."""
    squared = table.voltage**2
    distinct = len(np.unique(squared))
    share = 2 * squared / max(float(squared.max(initial=0.0)), 1.0) - 1
    return np.asarray(legendre.legvander(share, max(0, min(_DEGREE, distinct - 2))), float)


def _standard(values: Array) -> Array:
    """Values with mean 0 and deviation 1; 0 where they do not differ."""
    spread = float(values.std())
    if spread <= 1e-12 * float(np.abs(values).max()):
        return 0 * values
    return np.asarray((values - values.mean()) / spread)


def _contrasts(table: ReadingTable) -> list[tuple[int, Array]]:
    """For each specimen that has readings, where there are several: its rows against the others."""
    numbers = np.unique(table.specimen)
    return [(int(k), _standard((table.specimen == k).astype(float)))
            for k in numbers] if len(numbers) > 1 else []


def _in_time(table: ReadingTable, size: Array, voltage: Array) -> list[ResidualPattern]:
    found = []
    elapsed = np.nan_to_num(table.states.elapsed[table.state])
    for name, values in (("order", np.nan_to_num(table.order)), ("time", elapsed)):
        if np.ptp(values) > 0:
            line = _standard(values)
            what = "their order" if name == "order" else "the time since the run began"
            words = f"readings wander with {what}"
            found.append(ResidualPattern(name, words, size[:, None] * np.stack([line, line**2 - 1],
                                                                               1)))
    direction = table.states.direction[table.state]
    if np.ptp(direction) > 0:
        found.append(ResidualPattern("direction", "readings differ on the way up and on the way "
                                                  "down",
                             (size * direction)[:, None] * voltage[:, :3]))
    return found


def _ramps(table: ReadingTable, size: Array, voltage: Array) -> Array:
    """A polynomial for each specimen under each mass that leaves some scatter."""
    keys = np.stack([table.specimen.astype(float), table.mass], 1)
    ramps, group, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    columns = []
    for number in range(len(ramps)):
        own = (group.ravel() == number).astype(float) * size
        degree = min(voltage.shape[1], max(1, int(count[number]) // 2))
        columns.append(own[:, None] * voltage[:, :degree])
    return np.concatenate(columns, axis=1)


@dataclass(frozen=True, eq=False)
class TestResult:
    """What tests found.

    ``p_values``: the probability that noise alone shows as much, of each pattern; ``p_value``: of
    the strongest of them, corrected for their number; ``noise``: over the stated one, known with so
    many degrees of ``freedom``.
    """

    p_values: dict[str, float]
    p_value: float
    noise: float
    freedom: float

    @property
    def strongest(self) -> str:
        """The least probable pattern by noise, one of few columns where there is a choice."""
        few = {name: p for name, p in self.p_values.items() if name != "ramps"} or self.p_values
        return min(few, key=lambda name: few[name])


@dataclass(frozen=True, eq=False)
class ResidualTests:
    """Tests of residuals over their noise against patterns, less what a model's unknowns take up.

    ``bases`` are orthonormal columns by name, shape (rows, columns); of those in ``one_sided`` only
    a positive part counts. ``smooth`` spans all of them, ``taken`` what the model's unknowns take
    up. ``freedom`` is that of the scatter about both, ``stated`` what the stated noise counts as.
    """

    bases: dict[str, Array]
    one_sided: frozenset[str]
    smooth: Array
    taken: Array
    freedom: float
    stated: float

    @classmethod
    def of(cls, table: ReadingTable, jacobian: Array, groups: Sequence[ResidualPattern],
           further: dict[str, Array] | None = None,
           one_sided: frozenset[str] = frozenset(), stated: float = STATED) -> ResidualTests:
        """For a table, patterns and the model's derivatives over the noise, shape (rows, unknowns).

        Parameters
        ----------
        further
            Columns over the noise to test too, by name.
        stated
            Degrees of freedom of the stated noise; 0 where there is none.
        """
        taken = orthonormal(jacobian)
        columns = {group.name: group.columns / table.sigma[:, None] for group in groups} | (further
                                                                                            or {})
        free = {name: without(taken, values) for name, values in columns.items()}
        bases = {name: orthonormal(values, np.abs(columns[name]).max())
                 for name, values in free.items()}
        bases = {name: basis for name, basis in bases.items() if basis.shape[1]}
        smooth = orthonormal(np.concatenate([*bases.values(), np.zeros((len(table), 1))], axis=1))
        freedom = len(table) - taken.shape[1] - smooth.shape[1]
        signs = {name: basis * np.sign(basis[:, 0] @ free[name][:, 0])
                 for name, basis in bases.items()
                 if name in one_sided and basis.shape[1] == 1}
        return cls(bases | signs, one_sided & set(signs), smooth, taken, float(max(freedom, 0)),
                   stated)

    @property
    def able(self) -> bool:
        """Whether there is a noise to compare with."""
        return bool(self.bases) and self.freedom + self.stated > 0

    def noise(self, residual: Array) -> float:
        """Scatter about smooth curves and stated noise together, over the stated one."""
        own = np.concatenate([self.smooth, self.taken], axis=1)
        rough = float(residual @ residual) - float(np.sum((own.T @ residual) ** 2))
        if self.stated > 0 and self.freedom > 0:
            rough = min(rough,
                        self.freedom * float(f_distribution.isf(_ROUGH, self.freedom, self.stated)))
        return float(np.sqrt(max(rough + self.stated, 1e-12) / (self.freedom + self.stated)))

    def __call__(self, residual: Array, generator: np.random.Generator) -> TestResult:
        """Test residuals at a best fit, shape (rows,), against their noise and the stated one."""
        return self.against(residual, self.freedom + self.stated, generator, self.noise(residual))

    def against(self, residual: Array, freedom: float, generator: np.random.Generator,
                noise: float = 1.0) -> TestResult:
        """Test residuals against a noise known with some degrees of freedom."""
        inner = self.smooth.T @ residual
        small = {name: self.smooth.T @ basis for name, basis in self.bases.items()}
        own = {name: float(self._p(name, basis.T @ inner[:, None], np.array([noise]), freedom)[0])
               for name, basis in small.items()}
        least = min(own.values(), default=1.0)
        draws = generator.standard_normal((self.smooth.shape[1], _DRAWS))
        scatter = np.sqrt(generator.chisquare(freedom, _DRAWS) / freedom)
        every = [self._p(name, basis.T @ draws, scatter, freedom) for name, basis in small.items()]
        corrected = float(np.mean(np.min(every, axis=0) <= least)) if every else 1.0
        bound = min(1.0, least * len(own)) if own else 1.0
        return TestResult(own, min(bound, max(corrected, 1 / _DRAWS)) if corrected > 0 else bound,
                          noise,
                     freedom)

    def _p(self, name: str, parts: Array, noise: Array, freedom: float) -> Array:
        """Probabilities of as much or more by noise alone.

        ``parts``, shape (columns, draws), over ``noise``.
        """
        count = parts.shape[0]
        found = f_distribution.sf((parts**2).sum(0) / count / noise**2, count, freedom)
        if name in self.one_sided:
            return np.asarray(np.where(parts[0] > 0, found / 2, 1 - found / 2))
        return np.asarray(found)


def orthonormal(columns: Array, scale: float = 0.0) -> Array:
    """An orthonormal basis of the columns' span.

    What is small beside ``scale`` or the largest is left out.
    """
    if not columns.shape[1]:
        return columns
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    least = max(_RANK * float(sizes.max(initial=0.0)), 1e-9 * scale * len(columns) ** 0.5, 1e-300)
    return np.asarray(left[:, sizes > least])


def without(basis: Array, columns: Array) -> Array:
    """Columns less their part in the span of an orthonormal basis."""
    left = columns - basis @ (basis.T @ columns)
    return np.asarray(left - basis @ (basis.T @ left))
