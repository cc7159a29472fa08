"""Controller of a steered plate: LQG with integral action before the inverse of the static map.

A Kalman filter estimates the plate's motion, the creep, and places added to the asked ones: they
walk at random, and swing at the frequency of the reference with an amplitude that walks. A
linear quadratic regulator moves the plate, and the added places are subtracted. So no error of
the film's gain remains, neither at rest nor at that frequency
(:mod:`tympan.studies.lumped.control.lqg` does the same for one voltage at rest).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from tympan.base.arrays import Array
from tympan.base.errors import Failure
from tympan.studies.lumped.steered.inverse import SteeredInverse
from tympan.studies.lumped.steered.model import SteeredModel

#: Weights of the asked place to try, over that of the error.
_WEIGHTS = np.geomspace(1e-3, 1e0, 4)
#: Variances to try of what acts on the plate at each sample, over the reading's.
_SHAKEN = np.geomspace(1e-2, 1e1, 4)
#: Variances of the random walks' steps to try, over the reading's variance.
_WALKS = np.geomspace(1e-4, 1e0, 5)
#: Largest singular value of the sensitivity: each channel then keeps a gain margin of 2.7 and a
#: phase margin of 36°.
_SENSITIVITY = 1.6
#: Frequency at which laws are compared, over the reference's. At that itself every law follows
#: after a time; the faster it learns, the better it is beside it.
_BESIDE = 1.05
#: Gain of the film on which laws are compared, over that of the design: a film is not known better.
_GAIN = 0.9
#: Frequencies of a loop, and the lowest over the highest.
_FREQUENCIES = 120
_LOWEST = 1e-4


@dataclass(frozen=True, eq=False)
class SteeredLaw:
    """v = C s + D (r, y) and s⁺ = A s + B (r, y) + G (v' − v), once an ``interval`` [s].

    s is the memory, r the wanted places, y the readings, v the asked places at rest; v' are those
    that the supply can hold. ``rest``: the memory after a long rest at places y. All places are
    relative to ``inverse.centre``.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    g: Array
    rest: Array
    interval: float
    inverse: SteeredInverse
    slopes: Array
    sensitivity: float
    amplitude: float

    def resting(self, place: Array) -> Array:
        """Make the memory of a plate that has rested at a place."""
        return np.asarray(self.rest @ (place - self.inverse.centre))

    def voltages(self, memory: Array, wanted: Array, reading: Array) -> tuple[Array, Array]:
        """Compute the segments' voltages [V] until the next sample, and the next memory."""
        inputs = np.concatenate([wanted, reading]) - np.tile(self.inverse.centre, 2)
        asked = self.c @ memory + self.d @ inputs
        known = np.clip(asked, -self.inverse.scale, self.inverse.scale)
        squared = self.inverse.squared(self.inverse.centre + known)
        given = np.clip(squared, 0.0, self.inverse.supply**2)
        missing = known - asked + self.slopes @ (given - squared)
        return np.sqrt(given), self.a @ memory + self.b @ inputs + self.g @ missing


@dataclass(frozen=True, eq=False)
class _Sampled:
    """Small motions about a rest, x⁺ = A x + B v, y = C x; v are the asked places at rest."""

    a: Array
    b: Array
    c: Array

    @classmethod
    def of(cls, model: SteeredModel, squared: Array, inverse: SteeredInverse, interval: float
           ) -> _Sampled:
        linear = model.linearise(squared)
        size, count = linear.b.shape[0], linear.c.shape[0]
        asked = np.linalg.pinv(linear.gain * inverse.supply**2) * inverse.supply**2
        whole = np.zeros((size + count, size + count))
        whole[:size, :size], whole[:size, size:] = linear.a, linear.b @ asked
        passed = expm(interval * whole)
        return cls(passed[:size, :size], passed[:size, size:], linear.c)


def design_law(model: SteeredModel, inverse: SteeredInverse, rests: Sequence[Array],
               interval: float, frequency: float) -> SteeredLaw:
    """Design the law that follows a frequency [Hz] best, of those that are robust at all rests.

    They are compared on a film whose gain is less than that of the design.

    ``rests``: U² of the segments [V²] about which the model is linearised; the law is that of the
    first one.

    Raises
    ------
    Failure
        Where no law tried is stable and robust at all of them.
    """
    plants = [_Sampled.of(model, squared, inverse, interval) for squared in rests]
    first, count = plants[0], plants[0].c.shape[0]
    omega = np.append(np.geomspace(_LOWEST, 1.0, _FREQUENCIES) * np.pi / interval,
                      2 * np.pi * _BESIDE * frequency)
    z = np.exp(1j * omega * interval)
    responses = [_response(plant.a, plant.b, plant.c, z) for plant in plants]
    unit = np.diag(1 / inverse.scale**2)
    regulators = [_regulator(first, unit, weight) for weight in _WEIGHTS]
    added = _Added.of(count, 2 * np.pi * frequency * interval)
    filters = [_filter(first, added, inverse.scale, *noise)
               for noise in product(_SHAKEN, _WALKS)]
    best, least, found = None, np.inf, (np.nan, np.nan)
    eye = np.eye(count)
    for regulator, (moved, walked) in product(regulators, filters):
        parts = _law(first, added, regulator, moved, walked)
        a, b, c, d, *_ = parts
        whole = _response(a, b, c, z) + d
        forward, back = whole[..., :count], whole[..., count:]
        sizes, errors = [], []
        for response in responses:
            turned = np.diag(1 / inverse.scale) @ (eye - response @ back) @ np.diag(inverse.scale)
            sizes.append(float((1 / np.linalg.svd(turned, compute_uv=False)[:, -1]).max()))
            weak = _GAIN * response[-1]
            follows = np.linalg.solve(eye - weak @ back[-1], weak @ forward[-1])
            errors.append(float(np.abs(np.abs(np.diag(follows)) - 1).max()))
        if max(sizes) > _SENSITIVITY or max(errors) >= least:
            continue
        if max(_poles(plant, parts) for plant in plants) < 1:
            best, least, found = parts, max(errors), (max(sizes), max(errors))
    if best is None:
        raise Failure("no controller of this sampling steers the film: sample it more often "
                      "(--interval)")
    slopes = model.linearise(rests[0]).gain
    return SteeredLaw(*best, interval, inverse, slopes, *found)


def _response(a: Array, b: Array, c: Array, z: Array) -> Array:
    matrices = z[:, None, None] * np.eye(len(a)) - a
    return np.asarray(c @ np.linalg.solve(matrices, np.broadcast_to(b, (len(z), *b.shape))))


def _regulator(plant: _Sampled, unit: Array, weight: float) -> Array:
    """Compute K of v = −K x that minimises e² + weight v², in units of the places' scales."""
    a, b, c = plant.a, plant.b, plant.c
    left = solve_discrete_are(a, b, c.T @ unit @ c, weight * unit)
    return np.asarray(np.linalg.solve(weight * unit + b.T @ left @ b, b.T @ left @ a))


@dataclass(frozen=True, eq=False)
class _Added:
    """Places that are added to the asked ones: w⁺ = R w, ``seen`` @ w is added."""

    turned: Array
    seen: Array

    @classmethod
    def of(cls, count: int, angle: float) -> _Added:
        """Add for each place a constant, and a swing that turns by an angle [rad] a sample."""
        cos, sin = np.cos(angle), np.sin(angle)
        one = np.array([[1.0, 0.0, 0.0], [0.0, cos, sin], [0.0, -sin, cos]])
        unit, seen = np.eye(count), np.array([[1.0, 1.0, 0.0]])
        return cls(np.asarray(np.kron(one, unit), float), np.asarray(np.kron(seen, unit), float))


def _filter(plant: _Sampled, added: _Added, scale: Array, shaken: float, walk: float
            ) -> tuple[Array, Array]:
    """Compute a Kalman filter's gains of the state and of the added places."""
    size, count = plant.b.shape
    more, square = len(added.turned), np.diag(scale**2)
    noise = np.zeros((size + more, size + more))
    a, c = np.zeros_like(noise), np.zeros((count, size + more))
    a[:size, :size], a[:size, size:], c[:, :size] = plant.a, plant.b @ added.seen, plant.c
    a[size:, size:] = added.turned
    noise[:size, :size] = shaken * plant.b @ square @ plant.b.T
    noise[size:, size:] = walk * np.kron(np.eye(more // count), square)
    spread = solve_discrete_are(a.T, c.T, noise, square)
    gain = np.linalg.solve(c @ spread @ c.T + square, c @ spread).T
    return gain[:size], gain[size:]


def _law(plant: _Sampled, added: _Added, regulator: Array, moved: Array, walked: Array
         ) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Join filter and regulator in one law; its memory is the predicted state and what is added."""
    a, b, c = plant.a, plant.b, plant.c
    (size, count), more = b.shape, len(added.turned)
    still = np.linalg.solve(np.eye(size) - a, b)
    feed = np.eye(count) + regulator @ still
    seen, slowed = np.eye(size) - moved @ c, a - b @ regulator
    law = np.block([[slowed @ seen, np.zeros((size, more))],
                    [-added.turned @ walked @ c, added.turned]])
    inputs = np.block([[b @ feed, slowed @ moved],
                       [np.zeros((more, count)), added.turned @ walked]])
    asked = np.hstack([added.seen @ walked @ c - regulator @ seen, -added.seen])
    through = np.hstack([feed, -added.seen @ walked - regulator @ moved])
    held = np.vstack([b, np.zeros((more, count))])
    return law, inputs, asked, through, held, np.vstack([still, np.zeros((more, count))])


def _poles(plant: _Sampled, law: Sequence[Array]) -> float:
    """Find the largest magnitude of the closed loop's poles."""
    a, b, c, d = law[:4]
    count = plant.c.shape[0]
    back, through = b[:, count:], d[:, count:]
    loop = np.block([[plant.a + plant.b @ through @ plant.c, plant.b @ c], [back @ plant.c, a]])
    return float(np.abs(np.linalg.eigvals(loop)).max())
