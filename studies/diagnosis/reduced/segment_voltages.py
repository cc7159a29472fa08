"""Polynomials in the squared voltages of several segments, and nodes that determine them.

The energy of a film is linear in the square of each segment's voltage where the film does not
move; what moves it makes a smooth function of all of them. Polynomials of a total degree describe
it with far fewer nodes than a product of polynomials.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from math import comb

import numpy as np
from numpy.polynomial import chebyshev
from scipy.linalg import qr

from tympan.base.arrays import Array, Numbers

#: Largest total degree: that of a film with one voltage.
_HIGHEST = 5
#: Degree for changes by effects, which are smoother.
_FEW = 2
#: Most terms. It limits the number of films that are solved; four segments have a degree of 4.
#: At 5 kV on four quarters of the paper's film the force is then met to 0.014 mN of 180, slopes to
#: 0.008 mrad; a degree of 3 takes half as many films and has five to eight times these errors.
_MOST = 70
#: Most places among which nodes are chosen. Those of many segments are drawn at random.
_CANDIDATES = 20_000


@dataclass(frozen=True)
class SegmentVoltages:
    """Polynomials in the squared voltages of ``segments``, each from 0 to 1."""

    segments: int

    @property
    def degree(self) -> int:
        """Total degree of the polynomials."""
        return max([_FEW, *(degree for degree in range(_FEW, _HIGHEST + 1)
                            if comb(self.segments + degree, degree) <= _MOST)])

    @cached_property
    def powers(self) -> Numbers:
        """Degrees of the terms in each voltage, shape (terms, segments), by total degree."""
        every = _of_degree(self.segments, self.degree)
        return np.array(sorted(every, key=lambda powers: (sum(powers), powers)))

    @cached_property
    def few(self) -> Numbers:
        """Numbers of the nodes that determine the terms of low degree."""
        terms = int((self.powers.sum(1) <= _FEW).sum())
        chosen = _determining(self.terms(self.nodes)[:, :terms])
        return np.sort(chosen)

    @cached_property
    def nodes(self) -> Array:
        """Squared voltages that determine all terms, shape (terms, segments), ascending in sum."""
        places = np.array(self._candidates)
        nodes = places[_determining(self.terms(places))]
        return np.asarray(nodes[np.argsort(nodes.sum(1), kind="stable")])

    @property
    def _candidates(self) -> Array:
        steps = (1 - np.cos(np.pi * np.arange(self.degree + 1) / self.degree)) / 2
        if len(steps) ** self.segments <= _CANDIDATES:
            return np.array(list(product(steps, repeat=self.segments)))
        drawn = np.random.default_rng(0).integers(0, len(steps), (_CANDIDATES, self.segments))
        return np.asarray(steps[drawn])

    def terms(self, squared: Array) -> Array:
        """Evaluate the terms at squared voltages (n, segments), shape (n, terms)."""
        along = chebyshev.chebvander(2 * squared - 1, self.degree)
        values = np.ones((len(squared), len(self.powers)))
        for segment in range(self.segments):
            values *= along[:, segment][:, self.powers[:, segment]]
        return values


@lru_cache
def segment_voltages(segments: int) -> SegmentVoltages:
    """Make the polynomials for a number of segments, once."""
    return SegmentVoltages(segments)


def _of_degree(segments: int, degree: int) -> list[tuple[int, ...]]:
    """List the powers of so many numbers whose sum is a degree at most."""
    if not segments:
        return [()]
    return [(first, *rest) for first in range(degree + 1)
            for rest in _of_degree(segments - 1, degree - first)]


def _determining(terms: Array) -> Numbers:
    """Choose as many rows as there are terms, so that they determine these well.

    They are approximate Fekete points: a QR factorisation with pivoting finds them (Sommariva,
    Vianello, Comput. Math. Appl. 57, 2009).
    """
    order = qr(terms.T, mode="r", pivoting=True)[1]
    return np.asarray(order[: terms.shape[1]])
