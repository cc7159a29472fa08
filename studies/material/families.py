"""Laws as families of curves to fit, with linear constants and shape constants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.complex_step import complex_step
from tympan.fem.film.laws import ArrudaBoyce, Gent, MooneyRivlin, NeoHooke, Ogden, Yeoh
from tympan.fem.film.laws.invariants import first_invariant
from tympan.geometry.specimen import Material

Bounds = tuple[float, float]


@dataclass(frozen=True)
class LawFamily:
    """A law with free constants: stress is linear in ``linear`` ones [Pa], not in ``shape`` ones.

    ``bounds`` are those of a shape constant, and searches begin between ``starts``; both depend on
    the largest I₁ − 3 of the readings.
    """

    name: str
    linear: tuple[str, ...]
    make: Callable[[Any, Any], Material]
    shape: tuple[str, ...] = ()
    bounds: Callable[[float], Bounds] = lambda excess: (0.0, 0.0)
    starts: Callable[[float], Bounds] = lambda excess: (0.0, 0.0)
    alike: bool = False  #: terms may change places; they are sorted by their shape constant
    simpler: str = "neo_hooke"  #: the law that remains where one of its terms is dropped

    @property
    def constants(self) -> tuple[str, ...]:
        return self.linear + self.shape

    def material(self, values: Array) -> Material:
        linear, shape = np.split(values, [len(self.linear)])
        return self.make(_plain(linear), _plain(shape))

    def columns(self, l1: Array, l2: Array, shape: Array) -> Array:
        """Compute nominal stress ∂W/∂λ₁ per linear constant, shape (readings, linear).

        It takes a complex ``shape``.
        """
        unit = np.eye(len(self.linear))
        laws = [self.make(_plain(row), _plain(shape)) for row in unit]
        return np.stack([np.broadcast_to(law.derivatives(l1, l2)[1], l1.shape) for law in laws],
                        axis=-1)

    def jacobian(self, l1: Array, l2: Array, values: Array) -> Array:
        """Differentiate nominal stress by every constant, with complex steps in shape constants."""
        linear, shape = np.split(values, [len(self.linear)])
        parts = [complex_step(lambda moved: self.columns(l1, l2, moved) @ linear, shape, row)
                 for row in np.eye(len(shape))]
        return np.column_stack([self.columns(l1, l2, shape), *parts])

    def stress(self, l1: Array, l2: Array, values: Array) -> Array:
        """Compute nominal stress [Pa]."""
        linear, shape = np.split(values, [len(self.linear)])
        return self.columns(l1, l2, shape) @ linear

    def ordered(self, values: Array) -> Array:
        """Order the terms of the law."""
        if not self.alike:
            return values
        linear, shape = np.split(values, [len(self.linear)])
        order = np.argsort(shape)
        return np.concatenate([linear[order], shape[order]])


def largest_excess(l1: Array, l2: Array) -> float:
    """Find the largest I₁ − 3."""
    return float(np.max(first_invariant(l1, l2)[0]))


def _plain(values: Array) -> tuple[Any, ...]:
    return tuple(value.item() for value in np.asarray(values))


def _ogden(terms: int) -> LawFamily:
    numbers = range(1, terms + 1)
    return LawFamily(f"ogden_{terms}", tuple(f"mu_{n}" for n in numbers),
                  lambda c, s: Ogden(c, tuple(power or 1e-9 for power in s)),
                  tuple(f"alpha_{n}" for n in numbers),
                  lambda excess: (-20.0, 20.0), lambda excess: (-5.0, 8.0), alike=True,
                  simpler="neo_hooke" if terms == 1 else f"ogden_{terms - 1}")


#: Families by the names that ``tympan material fit --law`` takes.
FAMILIES = {family.name: family for family in (
    LawFamily("neo_hooke", ("mu",), lambda c, _: NeoHooke(*c)),
    LawFamily("mooney_rivlin", ("c10", "c01"), lambda c, _: MooneyRivlin(*c)),
    LawFamily("yeoh", ("c10", "c20", "c30"), lambda c, _: Yeoh(c)),
    LawFamily("gent", ("mu",), lambda c, s: Gent(*c, *s), ("j_lim",),
           lambda excess: (1.0001 * excess, 1e4), lambda excess: (1.05 * excess, 10 * excess + 10)),
    LawFamily("arruda_boyce", ("mu",), lambda c, s: ArrudaBoyce(*c, *s), ("lambda_lock",),
           lambda excess: (1.0001 * (excess / 3 + 1) ** 0.5, 100.0),
           lambda excess: (1.05 * (excess / 3 + 1) ** 0.5, 3 * (excess / 3 + 1) ** 0.5)),
    _ogden(1), _ogden(2), _ogden(3),
)}
