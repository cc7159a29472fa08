"""Probability of readings under a hypothesis, integrated over its unknowns: Laplace, quadrature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import logsumexp, ndtr, ndtri

from tympan.base.arrays import Array
from tympan.studies.diagnosis.fits.fit import NUISANCE, Fit
from tympan.studies.diagnosis.hypothesis import FACTORS, SIZES, parameters_of

#: Quadrature points of a size, for one size, two, three or more sizes. The sum runs over all
#: products.
_NODES = (32, 20, 12, 6, 4, 3)
#: Points in a size whose limits are computed: quantiles are interpolated between them.
_FINE = 128
#: Range of the quadrature in standard deviations: 2e-9 of a normal distribution is beyond.
_REACH = 6.0

#: Standard deviations from a bound within which a value counts as lying on it.
_AT_BOUND = 1e-6


def evidence(fit: Fit, widen: float = 1.0) -> float:
    """Compute the logarithm of the integral of prior times likelihood.

    The prior scales are multiplied by ``widen``. The log-likelihood is taken as a parabola about
    the fit (Laplace's approximation). It is integrated exactly over stiffness and permittivity, and
    by quadrature within their limits over the sizes with their own priors.
    """
    parabola = _Parabola.of(fit)
    sizes = _fitted(fit)
    if not sizes:
        return parabola.top
    _, logs = parabola.quadrature(fit, fit.bounds, widen, sizes)
    return parabola.top + float(logsumexp(logs))


def _fitted(fit: Fit) -> list[int]:
    """List the places of sizes that are fitted: all but switches, which are on."""
    return [place for place, parameter in enumerate(parameters_of(fit.hypothesis))
            if not parameter.switch]


def interval(fit: Fit, number: int) -> tuple[float, float, float]:
    """Find an unknown's best value and 95 % limits; a bound that the value lies on is a limit."""
    centre, width = float(fit.unknowns[number]), float(fit.deviations[number])
    if number >= SIZES.start and number - SIZES.start not in _fitted(fit):
        return centre, centre, centre
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
    """Find sizes below which given shares of an effect's posterior lie, marginal over the others.

    ``number`` is the place of the size among the unknowns. The quadrature is that of the evidence
    and covers the full range of sizes, so a size that the readings hardly determine has the prior's
    limits.
    """
    sizes, first = _fitted(fit), number - SIZES.start
    places, logs = _Parabola.of(fit).quadrature(
        fit, fit.limits, fit.widen, [first, *(size for size in sizes if size != first)], _FINE)
    weight = np.exp(logs - logs.max()).reshape(_FINE, -1).sum(1)
    below = (np.cumsum(weight) - 0.5 * weight) / weight.sum()
    return np.interp(shares, below, places[:: len(places) // _FINE, 0])


@dataclass(frozen=True, eq=False)
class _Parabola:
    """Log-likelihood about a fit as a function of the sizes; the two factors are at their best.

    It is ``top`` - ``slope``·x - x·``curvature``·x/2, where x are the sizes minus those of the fit.
    """

    top: float
    slope: Array
    curvature: Array

    @classmethod
    def of(cls, fit: Fit) -> _Parabola:
        """Integrate over stiffness and permittivity with their prior."""
        weights = np.zeros(len(fit.unknowns))
        weights[FACTORS] = NUISANCE**-2.0
        # A factor at its bound stays there for all sizes.
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
        """Build nodes, shape (n, sizes) in that ``order``, and the logarithms of their weights.

        The weights are of priors times exp(-slope·x - x·curvature·x/2) within ``bounds``. Sizes are
        taken one after the other, by Gauss–Legendre quadrature in the inverse hyperbolic sine of
        the size over its scale, centred where the sizes before it leave it. ``first``: number of
        nodes in the first size.
        """
        count = len(order)
        parameters = parameters_of(fit.hypothesis)
        priors = [parameters[k].prior.widened(widen) for k in order]
        scales = np.array([prior.scale for prior in priors])
        sizes = fit.unknowns[SIZES][order]
        low, high = bounds[:, SIZES][:, order]
        slope = self.slope[order]
        # A size that the readings do not determine keeps a small curvature within its prior.
        curvature = self.curvature[np.ix_(order, order)] + np.diag((1e-3 / scales) ** 2)
        places, logs = np.zeros((1, count)), np.zeros(1)
        for k in range(count):
            nodes, weights = _legendre(first if first and k == 0 else _NODES[count - 1])
            last = slice(k, count)
            inverse = np.linalg.inv(curvature[last, last])
            towards = slope[last] + places[:, :k] @ curvature[:k, last]
            centre, width = -(towards @ inverse)[:, 0], inverse[0, 0] ** 0.5
            # Where the likelihood falls from a limit, integrate as far as it falls.
            with np.errstate(over="ignore"):  # if it does not fall
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
    """Compute nodes and weights of Gauss–Legendre quadrature."""
    return np.polynomial.legendre.leggauss(count)
