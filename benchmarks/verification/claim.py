"""What a claim is: numbers of the program beside others, and how far apart they may be."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Pair:
    """One number computed by the program and its independent reference, in the same ``unit``.

    The error is relative to the reference, or absolute where that is 0. ``at_least``: only falling
    short counts, and counts absolutely; that is for orders of convergence.
    """

    quantity: str
    computed: float
    reference: float
    unit: str = ""
    at_least: bool = False

    @property
    def error(self) -> float:
        """How far the computed number is from its reference; infinite if it is no number."""
        if not math.isfinite(self.computed):
            return math.inf
        if self.at_least:
            return max(0.0, self.reference - self.computed)
        scale = abs(self.reference) or 1.0
        return abs(self.computed - self.reference) / scale


@dataclass(frozen=True)
class Claim:
    """``title``, source of the ``reference``, largest error allowed, what computes the pairs."""

    title: str
    reference: str
    tolerance: float
    pairs: Callable[[], Iterable[Pair]]

    def judged(self) -> Iterator[tuple[Pair, bool]]:
        """Every pair and whether it is within the tolerance; a claim without pairs is refused."""
        judged = [(pair, pair.error <= self.tolerance) for pair in self.pairs()]
        if not judged:
            raise ValueError(f"{self.title}: nothing was compared")
        yield from judged


CLAIMS: list[Claim] = []


def claim(title: str, *, reference: str, tolerance: float
          ) -> Callable[[Callable[[], Iterable[Pair]]], Callable[[], Iterable[Pair]]]:
    """Register a function of pairs as a claim of the page.

    The order of definition is that of the page.
    """
    def register(pairs: Callable[[], Iterable[Pair]]) -> Callable[[], Iterable[Pair]]:
        CLAIMS.append(Claim(title, reference, tolerance, pairs))
        return pairs

    return register
