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

#: What a misfit is, by the first word of its pattern's name; {1} is the rest of it.
WORDS = {
    "level": "all readings are off by about the same length",
    "voltage": "the way it depends on voltage is wrong",
    "specimen": "{1} is off against the other specimens",
    "mass": "the way it depends on mass is wrong",
    "order": "readings wander with their order",
    "time": "readings wander with the time since the run began",
    "direction": "readings differ on the way up and on the way down",
    "fitted": "large deflections are off against small ones",
    "ramps": "single ramps are off in different ways",
}

_DEGREE = 4
_RANK = 1e-6
_DRAWS = 4000

#: Degrees of freedom a stated noise counts as: it is taken to be right within about a quarter.
STATED = 8.0
#: Probability below which scatter beyond the stated noise is no noise: what no curve here follows
#: may be a misfit too.
_ROUGH = 1e-3


def words_of(name: str) -> str:
    """What a misfit of a pattern is, in words."""
    return WORDS[name.split()[0]].format(*name.split(" ", 1))


def patterns(table: ReadingTable, names: Sequence[str], predicted: Array) -> dict[str, Array]:
    """By name, columns a misfit may be a combination of, in units of the readings.

    ``names`` are the specimens', ``predicted`` what the nominal model says.
    """
    size = np.full(len(table), float(np.sqrt(np.mean(predicted**2))))
    voltage, numbers = _legendre(table.voltage**2), np.unique(table.specimen)
    few = voltage[:, :3]
    columns = {"level": size[:, None] * voltage[:, :1], "voltage": size[:, None] * voltage[:, 1:]}
    for number in numbers if len(numbers) > 1 else ():
        contrast = _standard((table.specimen == number).astype(float))
        columns[f"specimen {names[number]}"] = (size * contrast)[:, None] * few
    columns["mass"] = (size * _standard(table.mass))[:, None] * few
    elapsed = np.nan_to_num(table.states.elapsed[table.state])
    for name, values in (("order", np.nan_to_num(table.order)), ("time", elapsed)):
        if np.ptp(values) > 0:
            line = _standard(values)
            columns[name] = size[:, None] * np.stack([line, line**2 - 1], 1)
    direction = table.states.direction[table.state]
    if np.ptp(direction) > 0:
        columns["direction"] = (size * direction)[:, None] * few
    columns["fitted value"] = np.stack([predicted, predicted * abs(predicted) / size.max()], 1)
    columns["ramps"] = np.concatenate([*columns.values(), _ramps(table, size, voltage)], axis=1)
    return {name: values for name, values in columns.items()
            if np.abs(values).max(initial=0.0) > 0}


def over(columns: dict[str, Array], table: ReadingTable) -> dict[str, Array]:
    """Patterns' columns over the noise of a table."""
    return {name: values / table.sigma[:, None] for name, values in columns.items()}


def _legendre(squared: Array) -> Array:
    share = 2 * squared / max(float(squared.max(initial=0.0)), 1.0) - 1
    degree = max(0, min(_DEGREE, len(np.unique(squared)) - 2))
    return np.asarray(legendre.legvander(share, degree), float)


def _standard(values: Array) -> Array:
    spread = float(values.std())
    if spread <= 1e-12 * float(np.abs(values).max()):
        return 0 * values
    return np.asarray((values - values.mean()) / spread)


def _ramps(table: ReadingTable, size: Array, voltage: Array) -> Array:
    """A polynomial for each specimen under each mass that leaves some scatter."""
    columns = [((table.ramp == number).astype(float) * size)[:, None]
               * voltage[:, : min(voltage.shape[1], max(1, rows // 2))]
               for number, rows in enumerate(np.bincount(table.ramp).tolist())]
    return np.concatenate(columns, axis=1)


@dataclass(frozen=True, eq=False)
class TestResult:
    """What tests found.

    ``p_values``: the probability that noise alone shows as much, of each pattern; ``p_value``: of
    the strongest of them, corrected for their number; ``noise``: over the stated one.
    """

    p_values: dict[str, float]
    p_value: float
    noise: float


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
    def of(cls, jacobian: Array, columns: dict[str, Array], stated: float = STATED,
           one_sided: frozenset[str] = frozenset()) -> ResidualTests:
        """For patterns' columns by name and a model's jacobian, both over the noise.

        ``stated`` are degrees of freedom of the stated noise, 0 where there is none.
        """
        taken = orthonormal(jacobian)
        free = {name: without(taken, values) for name, values in columns.items()}
        bases = {name: orthonormal(values, np.abs(columns[name]).max())
                 for name, values in free.items()}
        bases = {name: basis for name, basis in bases.items() if basis.shape[1]}
        smooth = orthonormal(np.hstack([*bases.values(), np.zeros((len(jacobian), 1))]))
        freedom = len(jacobian) - taken.shape[1] - smooth.shape[1]
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
        spanned = np.concatenate([self.smooth, self.taken], axis=1)
        rough = float(residual @ residual) - float(np.sum((spanned.T @ residual) ** 2))
        if self.stated > 0 and self.freedom > 0:
            most = float(f_distribution.isf(_ROUGH, self.freedom, self.stated))
            rough = min(rough, self.freedom * most)
        return float(np.sqrt(max(rough + self.stated, 1e-12) / (self.freedom + self.stated)))

    def __call__(self, residual: Array, generator: np.random.Generator,
                 known: float | None = None) -> TestResult:
        """Test residuals at a best fit, shape (rows,), against their noise and the stated one.

        Or against the stated noise alone, ``known`` with so many degrees of freedom.
        """
        noise = self.noise(residual) if known is None else 1.0
        freedom = self.freedom + self.stated if known is None else known
        inner = self.smooth.T @ residual
        small = {name: self.smooth.T @ basis for name, basis in self.bases.items()}
        p_values = {name: float(self._p(name, basis.T @ inner[:, None], np.array([noise]),
                                        freedom)[0]) for name, basis in small.items()}
        least = min(p_values.values(), default=1.0)
        draws = generator.standard_normal((self.smooth.shape[1], _DRAWS))
        scatter = np.sqrt(generator.chisquare(freedom, _DRAWS) / freedom)
        every = [self._p(name, basis.T @ draws, scatter, freedom) for name, basis in small.items()]
        corrected = float(np.mean(np.min(every, axis=0) <= least)) if every else 1.0
        bound = min(1.0, least * len(p_values)) if p_values else 1.0
        p_value = min(bound, max(corrected, 1 / _DRAWS)) if corrected > 0 else bound
        return TestResult(p_values, p_value, noise)

    def _p(self, name: str, parts: Array, noise: Array, freedom: float) -> Array:
        count = parts.shape[0]
        tail = f_distribution.sf((parts**2).sum(0) / count / noise**2, count, freedom)
        if name in self.one_sided:
            return np.asarray(np.where(parts[0] > 0, tail / 2, 1 - tail / 2))
        return np.asarray(tail)


def orthonormal(columns: Array, scale: float = 0.0) -> Array:
    """A basis of the columns' span, without what is small beside ``scale`` or the largest."""
    if not columns.shape[1]:
        return columns
    basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    least = max(_RANK * float(sizes.max(initial=0.0)), 1e-9 * scale * len(columns) ** 0.5, 1e-300)
    return np.asarray(basis[:, sizes > least])


def without(basis: Array, columns: Array) -> Array:
    """Columns less their part in the span of an orthonormal basis."""
    rest = columns - basis @ (basis.T @ columns)
    return np.asarray(rest - basis @ (basis.T @ rest))
