"""Squares of the segments' voltages that hold a plate: the inverse of the static map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import Failure
from tympan.studies.lumped.steered.model import SteeredModel, powers_of

#: Total degree of the polynomials, and places to which they are fitted.
_DEGREE = 4
_PLACES = 120
#: Reach of the polynomials beyond the wanted places, over their range: feedback asks for more.
_BEYOND = 0.6
#: Least reach of the polynomials, over half the range of all equilibria: films differ by a tenth.
_LEAST = 0.55
#: Newton's corrections of a place, and the last one over the range.
_CORRECTIONS = 40
_LAST = 1e-11
#: Seed of the places; its value is arbitrary.
_SEED = 2


@dataclass(frozen=True, eq=False)
class SteeredInverse:
    """U² of the segments as polynomials of the plate's steered freedoms at rest.

    Terms are products of powers of (v − ``centre``)/``scale``: ``powers``, (terms, steered), with
    ``coefficients``, (segments, terms) [V²]. ``error``: largest error over the supply's U².
    """

    centre: Array
    scale: Array
    powers: Numbers
    coefficients: Array
    supply: float
    error: float

    @classmethod
    def of(cls, model: SteeredModel, wanted: Array, supply: float) -> SteeredInverse:
        """Fit the inverse about wanted places at rest, (places, steered), and beyond them.

        Raises
        ------
        Failure
            Where the supply cannot hold the plate at one of the wanted places.
        """
        centre = (wanted.max(0) + wanted.min(0)) / 2
        scale = np.maximum((1 + _BEYOND) * np.ptp(wanted, axis=0) / 2,
                           _LEAST * model.scale[model.steered])
        random = np.random.default_rng(_SEED)
        places = centre + scale * random.uniform(-1, 1, size=(_PLACES, len(scale)))
        made = np.array([voltages_at(model, place, supply) for place in places])
        powers = powers_of(len(centre), _DEGREE)
        blank = cls(centre, scale, powers, np.zeros((made.shape[1], len(powers))), supply, 0.0)
        terms = np.array([blank._terms(place) for place in places])
        found = np.linalg.lstsq(terms, made)[0].T
        error = float(np.abs(terms @ found.T - made).max() / supply**2)
        inverse = cls(centre, scale, powers, found, supply, error)
        needed = np.array([inverse.squared(place) for place in wanted])
        if needed.min() < 0 or needed.max() > supply**2:
            raise Failure(f"segments need {np.sqrt(max(needed.max(), 0.0)) / 1e3:.3g} kV at most, "
                          "and some less than none, to hold the plate there: choose a smaller "
                          "tilt or a higher supply")
        return inverse

    def squared(self, place: Array) -> Array:
        """Compute U² of the segments that hold the plate at a place at rest [V²]."""
        return np.asarray(self.coefficients @ self._terms(place))

    def _terms(self, place: Array) -> Array:
        s = (place - self.centre) / self.scale
        power = s[:, None] ** np.arange(int(self.powers.max()) + 1)
        return np.asarray(power[np.arange(len(s)), self.powers].prod(1))


def voltages_at(model: SteeredModel, place: Array, supply: float) -> Array:
    """Solve U² of the segments [V²] that hold the plate at steered freedoms at rest.

    Freedoms that are not steered take their equilibrium. Of several solutions it is the one
    nearest to equal voltages, half of the supply's U².
    """
    return held_at(model, place, supply)[0]


def held_at(model: SteeredModel, place: Array, supply: float,
            stiffness: Array | float = 0.0, force: Array | float = 0.0) -> tuple[Array, Array]:
    """Solve U² [V²] as :func:`voltages_at` does, against an added stiffness and force.

    The force on the freedoms p is ``stiffness`` @ p + ``force``. The second result is p.
    """
    middle = np.full(len(model.segments), supply**2 / 2)
    added = stiffness * np.eye(model.count) if np.ndim(stiffness) == 0 else np.asarray(stiffness)
    p, u = model.rest(middle), middle.copy()
    p[model.steered] = place
    hidden = [number for number in range(model.count) if number not in model.steered]
    for _ in range(_CORRECTIONS):
        pull, own, by_u = model.pull(p, u)
        pull = pull + added @ p + force
        # Unknowns in units of their size: U² over the supply's, freedoms over their ranges.
        matrix = np.hstack([by_u * supply**2, (own + added)[:, hidden] * model.scale[hidden]])
        rows = 1 / np.linalg.norm(matrix, axis=1)
        offset = np.concatenate([(middle - u) / supply**2, np.zeros(len(hidden))])
        change = offset + np.linalg.pinv(matrix * rows[:, None]) @ (
            -rows * (pull + matrix @ offset))
        u = u + supply**2 * change[:len(u)]
        p[hidden] += model.scale[hidden] * change[len(u):]
        if np.abs(change).max() < _LAST:
            return u, p
    raise Failure("no voltages of the segments hold the plate there: choose a smaller tilt")
