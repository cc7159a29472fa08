"""Structure of residuals: tests with smooth columns by voltage, mass, specimen and time.

Noise is rough: what is smooth along a ramp is not noise. So the scatter about smooth curves
measures the noise whether or not the stated noise is right, and the smooth part of the residuals
is the error of the simulation. Jumps are rough too: patterns of jumps are tested one by one, each
against the scatter that remains without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.stats import f as f_distribution

from tympan.base.arrays import Array, Numbers
from tympan.studies.diagnosis.inference.projection import (
    RANK,
    orthonormal,
    taken_by,
    told_apart,
    without,
)
from tympan.studies.diagnosis.patterns.reading_patterns import JUMPS, PATTERNS, words_of
from tympan.studies.estimation.noise import STATED, Noise

#: Sets of noise drawn to find how large ratios become by chance.
_DRAWS = 4000

#: Most jumps that are removed from the scatter, as a share of its degrees of freedom: the remainder
#: must still determine the noise.
_MOST_JUMPS = 0.25
#: Probability by noise below which a jump counts, allowing for the number of jumps tried.
_CLEAR = 1e-3

#: Probability below which scatter beyond the stated noise is not all noise: a misfit that no curve
#: here follows may be part of it.
_ROUGH = 1e-3


@dataclass(frozen=True, eq=False)
class TestResult:
    """Result of tests of residuals.

    ``p_values``: for each pattern the probability that noise alone shows as much; ``p_value``: that
    of the strongest one, corrected for their number; ``noise``: noise over the stated one, known
    with ``freedom`` degrees of freedom; ``reading``: number of the reading from which readings are
    shifted, if they are.
    """

    p_values: dict[str, float]
    p_value: float
    noise: float
    freedom: float
    reading: int = 0

    def words(self, name: str) -> str:
        """Describe a misfit of a pattern in words."""
        if name == "step" and self.reading:
            return PATTERNS["shifted"].what.format(self.reading)
        return words_of(name)


@dataclass(frozen=True, eq=False)
class ResidualTests:
    """Tests of residuals over their noise against patterns, without what unknowns absorb.

    ``bases``: orthonormal columns by name, shape (rows, columns); for those in ``one_sided`` only a
    positive part counts. ``jumps``: columns of length 1, any of which may be present. ``smooth``:
    basis of all ``bases``; ``taken``: basis of what the model's unknowns absorb. ``freedom``:
    degrees of freedom of the scatter about both; ``stated``: degrees of freedom that the stated
    noise counts as. ``readings``: numbers of the readings at which steps begin.
    """

    bases: dict[str, Array]
    one_sided: frozenset[str]
    jumps: dict[str, Array]
    smooth: Array
    taken: Array
    freedom: float
    stated: float
    readings: Numbers

    @classmethod
    def of(cls, jacobian: Array, columns: dict[str, Array], stated: float = STATED,
           one_sided: frozenset[str] = frozenset()) -> ResidualTests:
        """Build from patterns' columns by name and a model's jacobian, both over the noise.

        ``stated``: degrees of freedom of the stated noise, 0 where there is none.
        """
        taken = taken_by(jacobian)
        columns = {name: values[:, told_apart(taken, values)] for name, values in columns.items()}
        free = {name: without(taken, values) for name, values in columns.items()}
        bases = {name: orthonormal(values) for name, values in free.items() if name not in JUMPS}
        bases = {name: basis for name, basis in bases.items() if basis.shape[1]}
        smooth = orthonormal(np.hstack([*bases.values(), np.zeros((len(jacobian), 1))]))
        freedom = len(jacobian) - taken.shape[1] - smooth.shape[1]
        signs = {name: basis * np.sign(basis[:, 0] @ free[name][:, 0])
                 for name, basis in bases.items()
                 if name in one_sided and basis.shape[1] == 1}
        jumps = {name: values / np.linalg.norm(values, axis=0) for name, values in free.items()
                 if name in JUMPS and values.shape[1]}
        steps = columns.get("step", np.zeros((len(jacobian), 0)))
        readings = 2 + np.sum(steps[np.any(steps != 0, axis=1)] == 0, axis=0)
        return cls(bases | signs, one_sided & set(signs), jumps, smooth, taken,
                   float(max(freedom, 0)), stated, readings)

    @property
    def able(self) -> bool:
        """Whether there is a noise to compare with."""
        return bool(self.bases) and self.freedom + self.stated > 0

    @cached_property
    def _small(self) -> dict[str, Array]:
        """Columns of all patterns in the basis of the smooth ones."""
        return {name: self.smooth.T @ columns
                for name, columns in (self.bases | self.jumps).items()}

    def noise(self, residual: Array) -> float:
        """Estimate the noise from scatter about smooth curves and stated noise, over the latter.

        Jumps that stand out are removed first, one after the other, up to the last that stands out
        from the remainder, since several hide one another (Rosner, Technometrics 25, 1983).
        """
        scatter = without(self.taken, residual)
        scatter, freedom = scatter - self.smooth @ (self.smooth.T @ scatter), self.freedom
        rough = [columns - self.smooth @ self._small[name] for name, columns in self.jumps.items()]
        jumps = np.hstack([*rough, np.zeros((len(residual), 1))])
        least, known = float(scatter @ scatter), freedom
        for _ in range(int(_MOST_JUMPS * freedom)):
            sizes = np.sum(jumps**2, axis=0)
            parts = (jumps.T @ scatter) ** 2 / np.where(sizes > RANK, sizes, np.inf)
            best = int(parts.argmax())
            if sizes[best] <= RANK:
                break
            squares = float(scatter @ scatter) - parts[best]
            others = self._variance(squares, self.stated, freedom - 1)
            tail = f_distribution.sf(parts[best] / others, 1, freedom - 1 + self.stated)
            unit = jumps[:, best] / sizes[best] ** 0.5
            scatter, jumps = scatter - unit * (unit @ scatter), jumps - np.outer(unit, unit @ jumps)
            freedom -= 1
            if len(sizes) * tail <= _CLEAR:
                least, known = float(scatter @ scatter), freedom
        return float(np.sqrt(self._variance(least, self.stated, known)))

    def _variance(self, squares: Any, stated: Any, freedom: float) -> Any:
        """Combine the squares of the rough part and those of the stated noise to a variance."""
        if self.stated > 0 and freedom > 0:
            most = float(f_distribution.isf(_ROUGH, freedom, self.stated))
            squares = np.minimum(squares, freedom * most)
        known = freedom + self.stated
        if not known > 0:  # neither readings nor statements say how large the noise is
            return np.full_like(squares, np.inf, dtype=float)
        return np.maximum(squares + stated, 1e-12) / known

    def __call__(self, residual: Array, generator: np.random.Generator,
                 found: Noise | None = None) -> TestResult:
        """Test residuals at a best fit, shape (rows,), against their noise and the stated one.

        Given the noise of each part as ``found`` before, test against that.
        """
        # Readings are drawn, not coefficients: bases turn with the last digit of a column.
        draws = np.column_stack([residual, generator.standard_normal((len(residual), _DRAWS))])
        if found is None:
            scatter = (generator.chisquare(self.stated, _DRAWS) if self.stated
                       else np.zeros(_DRAWS))
            every = self._ratios(draws, np.r_[self.stated, scatter])
        else:
            variances = np.column_stack([np.ones(len(found.freedom)),
                                         found.variances(generator, _DRAWS)])
            every = self._ratios_to(found, draws, variances)
        tails = {name: self._tail(name, *ratios) for name, ratios in every.items()}
        p_values = {name: float(tail[0]) for name, tail in tails.items()}
        least = min(p_values.values(), default=1.0)
        corrected = (float(np.mean(np.min([tail[1:] for tail in tails.values()], axis=0) <= least))
                     if tails else 1.0)
        bound = min(1.0, least * len(p_values)) if p_values else 1.0
        p_value = min(bound, max(corrected, 1 / _DRAWS)) if corrected > 0 else bound
        step = every["step"][0][:, 0].argmax() if "step" in every else None
        noise, freedom = ((self.noise(residual), self.freedom + self.stated) if found is None
                          else (1.0, float(found.freedom.sum())))
        return TestResult(p_values, p_value, noise, freedom,
                          0 if step is None else int(self.readings[step]))

    def _ratios(self, residuals: Array, stated: Array) -> dict[str, tuple[Array, int, float]]:
        """Compute variance ratios of residuals, shape (n,), and degrees of freedom, by pattern.

        For jumps the ratios are those of each column, shape (columns, n).
        """
        inner = self.smooth.T @ residuals
        squares = np.sum(residuals**2, axis=0) - np.sum((self.taken.T @ residuals) ** 2, axis=0)
        squares = squares - np.sum(inner**2, axis=0)
        freedom = self.freedom + self.stated
        variance = self._variance(squares, stated, self.freedom)
        ratios = {name: (self._mean_square(name, inner) / variance, basis.shape[1], freedom)
                  for name, basis in self.bases.items()}
        apart = self.freedom >= 2
        for name, columns in self.jumps.items():
            parts = columns.T @ residuals
            if apart:
                rough = parts - self._small[name].T @ inner
                sizes = 1 - np.sum(self._small[name] ** 2, axis=0)
                others = squares - rough**2 / np.where(sizes > RANK, sizes, np.inf)[:, None]
                variance = self._variance(others, stated, self.freedom - 1)
            ratios[name] = parts**2 / variance, 1, freedom - apart
        return ratios

    def _ratios_to(self, found: Noise, residuals: Array, variances: Array
                   ) -> dict[str, tuple[Array, int, float]]:
        """Compute these ratios to noise whose parts have these ``variances``, (parts, n).

        A pattern's noise is the mean over the parts it is in, weighted by its share in each.
        """
        inner, ratios = self.smooth.T @ residuals, {}
        for name, columns in self.bases.items():
            shares = found.shares(columns)
            ratios[name] = (self._mean_square(name, inner) / (shares @ variances),
                            columns.shape[1], found.freedom_of(shares))
        for name, columns in self.jumps.items():
            shares = found.shares(columns)
            ratios[name] = ((columns.T @ residuals) ** 2 / (shares @ variances), 1,
                            found.freedom_of(shares))
        return ratios

    def _mean_square(self, name: str, inner: Array) -> Array:
        """Compute residuals' mean square along a pattern, (n,); negative on its wrong side."""
        parts = self._small[name].T @ inner
        squares = np.sum(parts**2, axis=0) / len(parts)
        return np.asarray(squares * np.sign(parts[0]) if name in self.one_sided else squares)

    def _tail(self, name: str, ratios: Array, count: int, freedom: float) -> Array:
        top = ratios.max(0, keepdims=True) if name in self.jumps else ratios
        tail = f_distribution.sf(np.abs(top), count, freedom)
        if name in self.one_sided:
            return np.asarray(np.where(ratios > 0, tail / 2, 1 - tail / 2))
        if name in self.jumps:
            tail = tail[0]
            # Effective number of columns: that which reaches as much in one draw of a hundred.
            many = 0.01 / max(float(np.quantile(tail[1:], 0.01)), 1e-300)
            return np.asarray(np.minimum(many * tail, 1.0))
        return np.asarray(tail)
