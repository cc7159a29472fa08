"""Probability of readings by a hypothesis, whatever its unknowns: Laplace and quadrature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import logsumexp, ndtr, ndtri

from tympan.base.arrays import Array
from tympan.studies.diagnosis.fits.fit import NUISANCE, Fit
from tympan.studies.diagnosis.hypothesis import FACTORS, SIZES, parameters_of

#: Points of quadrature in one size, in each of two, of three or more: all their products are
#: summed.
_NODES = (32, 20, 12, 6, 4, 3)
#: Points in a size of which limits are asked: quantiles are interpolated between them.
_FINE = 128
#: How far the quadrature reaches, in standard deviations: 2e-9 of a normal distribution is beyond.
_REACH = 6.0

#: Standard deviations within which a value lies on a bound.
_AT_BOUND = 1e-6


def evidence(fit: Fit, widen: float = 1.0) -> float:
    """Logarithm of the integral of prior times likelihood, usual sizes ``widen`` times as large.

    The logarithm of likelihood is taken as a parabola about the fit, Laplace's approximation. It is
    integrated exactly over stiffness and permittivity, and with the sizes' priors as they are by
    quadrature within their limits.
    """
    parabola = _Parabola.of(fit)
    if not fit.hypothesis:
        return parabola.top
    sizes = list(range(len(fit.unknowns) - SIZES.start))
    _, logs = parabola.quadrature(fit, fit.bounds, widen, sizes)
    return parabola.top + float(logsumexp(logs))


def interval(fit: Fit, number: int) -> tuple[float, float, float]:
    """An unknown's most probable value and 95 % limits; a bound that the value lies on is one."""
    centre, width = float(fit.unknowns[number]), float(fit.deviations[number])
    low, high = ((bound - centre) / width for bound in fit.bounds[:, number])
    parts = ((0.0, 0.95) if low >= -_AT_BOUND else (0.05, 1.0) if high <= _AT_BOUND
             else (0.025, 0.975))
    if number < SIZES.start:
        below, above = ndtr(low), ndtr(high)
        limits = centre + width * ndtri(below + np.array(parts) * (above - below))
    else:
        limits = quantiles(fit, number, parts)
    return centre, min(float(limits[0]), centre), max(float(limits[1]), centre)


def quantiles(fit: Fit, number: int, shares: Sequence[float]) -> Array:
    """Sizes below which shares of an effect's posterior lie, the other unknowns whatever they are.

    ``number`` is the place of the size among the unknowns. By the same quadrature as the evidence,
    as far as sizes may go, so that one that readings hardly tell has the prior's limits.
    """
    sizes = list(range(len(fit.unknowns) - SIZES.start))
    first = number - SIZES.start
    places, logs = _Parabola.of(fit).quadrature(
        fit, fit.limits, fit.widen, [first, *(size for size in sizes if size != first)], _FINE)
    weight = np.exp(logs - logs.max()).reshape(_FINE, -1).sum(1)
    below = (np.cumsum(weight) - 0.5 * weight) / weight.sum()
    return np.interp(shares, below, places[:: len(places) // _FINE, 0])


@dataclass(frozen=True, eq=False)
class _Parabola:
    """The logarithm of likelihood about a fit, stiffness and permittivity at their best.

    ``top`` - ``slope``·x - x·``curvature``·x/2, x the sizes less those of the fit.
    """

    top: float
    slope: Array
    curvature: Array

    @classmethod
    def of(cls, fit: Fit) -> _Parabola:
        """Integrated over stiffness and permittivity and their prior."""
        weights = np.zeros(len(fit.unknowns))
        weights[FACTORS] = NUISANCE**-2.0
        # A factor at its bound stays there whatever the sizes are.
        moves = np.ones(len(fit.unknowns))
        moves[FACTORS] = ~fit.stopped[FACTORS]
        jacobian, residual = fit.whitened(fit.jacobian) * moves, fit.whitened(fit.residual)
        precision = jacobian.T @ jacobian + np.diag(weights)
        slope = moves * weights * fit.unknowns - jacobian.T @ residual
        inner = precision[FACTORS, FACTORS]
        top = -0.5 * float(residual @ residual + weights @ fit.unknowns**2)
        top -= fit.beside.log_volume if fit.beside is not None else 0.0
        top += 0.5 * float(slope[FACTORS] @ np.linalg.solve(inner, slope[FACTORS]))
        top -= 0.5 * np.linalg.slogdet(inner)[1] + np.log(NUISANCE).sum()
        gain = np.linalg.solve(inner, precision[FACTORS, SIZES])
        return cls(float(top), slope[SIZES] - gain.T @ slope[FACTORS],
                   precision[SIZES, SIZES] - precision[SIZES, FACTORS] @ gain)

    def quadrature(self, fit: Fit, bounds: Array, widen: float, order: Sequence[int],
                   first: int | None = None) -> tuple[Array, Array]:
        """Nodes, shape (n, sizes) in that ``order``, and the logarithms of their weights.

        Weights are of priors times exp(-slope·x - x·curvature·x/2) within ``bounds``. One size
        after the other, by Gauss–Legendre quadrature in the inverse hyperbolic sine of its size
        over its scale, about where those before it leave it. ``first``: nodes in the first size.
        """
        count = len(order)
        parameters = parameters_of(fit.hypothesis)
        priors = [parameters[k].prior.widened(widen) for k in order]
        scales = np.array([prior.scale for prior in priors])
        sizes = fit.unknowns[SIZES][order]
        low, high = bounds[:, SIZES][:, order]
        slope = self.slope[order]
        # A size that readings do not tell keeps a little curvature, of what priors allow.
        curvature = self.curvature[np.ix_(order, order)] + np.diag((1e-3 / scales) ** 2)
        places, logs = np.zeros((1, count)), np.zeros(1)
        for k in range(count):
            nodes, weights = _legendre(first if first and k == 0 else _NODES[count - 1])
            last = slice(k, count)
            inverse = np.linalg.inv(curvature[last, last])
            towards = slope[last] + places[:, :k] @ curvature[:k, last]
            centre, width = -(towards @ inverse)[:, 0], inverse[0, 0] ** 0.5
            # Where likelihood falls from a limit, as far as it falls.
            with np.errstate(over="ignore"):  # where it does not fall at all
                fall = np.minimum(_REACH * width,
                                  40 * width**2 / np.maximum(np.abs(centre), 1e-300))
            from_, to = low[k] - sizes[k], high[k] - sizes[k]
            near, far = np.clip(centre, from_, to) - fall, np.clip(centre, from_, to) + fall
            lower = np.clip(np.minimum(np.minimum(centre - _REACH * width, near), 0.0), from_, to)
            upper = np.clip(np.maximum(np.maximum(centre + _REACH * width, far), 0.0), from_, to)
            begin, end = (np.arcsinh((edge + sizes[k]) / scales[k]) for edge in (lower, upper))
            at = 0.5 * (begin + end)[:, None] + 0.5 * (end - begin)[:, None] * nodes
            inside = scales[k] * np.sinh(at)
            measure = 0.5 * (end - begin)[:, None] * weights * scales[k] * np.cosh(at)
            logs = (logs[:, None] + np.log(np.maximum(measure, 1e-300))
                    + priors[k].logpdf(inside)).ravel()
            places = np.repeat(places, len(nodes), axis=0)
            places[:, k] = (inside - sizes[k]).ravel()
        logs = logs - places @ slope - 0.5 * np.einsum("ni,ij,nj->n", places, curvature, places)
        return places + sizes, logs


@lru_cache
def _legendre(count: int) -> tuple[Array, Array]:
    """Nodes and weights of Gauss–Legendre quadrature."""
    return np.polynomial.legendre.leggauss(count)
