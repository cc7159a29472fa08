"""Controller of a steered plate: feed-forward of the wanted motion, and feedback about it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import Failure
from tympan.fem.rig import Sensor
from tympan.studies.lumped.control.controller import Method
from tympan.studies.lumped.control.design import SENSITIVITY
from tympan.studies.lumped.control.loop import RunMargins
from tympan.studies.lumped.steered.forward import Forward
from tympan.studies.lumped.steered.inverse import SteeredInverse
from tympan.studies.lumped.steered.loop import (
    Complex,
    Feedback,
    SteeredLoop,
    frequencies,
    sensitivities,
)
from tympan.studies.lumped.steered.lqg import lqg_candidates
from tympan.studies.lumped.steered.model import SteeredModel
from tympan.studies.lumped.steered.pi import pi_by_channel

#: Frequency at which laws are compared, over the reference's. At that itself every law follows
#: after a time; the faster it learns, the better it is beside it.
_BESIDE = 1.05
#: Sensitivity beside the frequency from which on a law hardly helps: it is none.
_HELPS = 0.7
#: Errors of the inertia for which a law is sought that bears them, in this order: the frequencies
#: of the swings are not known better than to a twentieth.
_INERTIAS_OFF = (0.1, 0.05, 0.0)
#: Number of frequencies for the margins.
_FREQUENCIES = 1500


@dataclass(frozen=True, eq=False)
class SteeredLaw:
    """v = C s + D (r, y) and s⁺ = A s + B (r, y) + G (v' − v), once an ``interval`` [s].

    s is the memory, r the places wanted at the end of the sample, y the readings at its start, v
    the asked places at rest; v' are those that the supply can hold. ``rest``: the memory after a
    long rest with wanted places r and readings y. All places are relative to ``inverse.centre``.
    ``slopes``: places at rest by U². Without a ``feedback`` the readings are ignored. The sensor
    lags by ``sensor_lag`` [s]: its reading is compared with wanted places that lag as much.
    """

    forward: Forward
    feedback: Feedback | None
    interval: float
    inverse: SteeredInverse
    slopes: Array
    sensor_lag: float = 0.0

    @cached_property
    def parts(self) -> tuple[Array, Array, Array, Array, Array, Array]:
        """A, B, C, D, G and ``rest``."""
        forward, count = self.forward, len(self.inverse.centre)
        if self.feedback is None:
            none = np.zeros((count, count))
            idle = np.zeros((len(forward.a), count))
            return (forward.a, np.hstack([forward.b, idle]), forward.c,
                    np.hstack([forward.d, none]), idle, np.hstack([forward.rest, idle]))
        own, size, more = self.feedback, len(forward.a), len(self.feedback.a)
        # Parts of the memory: the forward part, wanted places as the sensor shows them, feedback.
        unit, sensor = np.eye(count), Sensor(sensor_lag=self.sensor_lag)
        shown, now, ahead = (sensor.lagged(*each, self.interval) for each in (
            (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
        held = np.zeros((count, size))
        held[:, size - 2 * count:size - count] = now * unit
        tall, wide, still = (np.zeros(each) for each in ((size, count), (count, more),
                                                         (count, count)))
        return (np.block([[forward.a, tall, np.zeros((size, more))],
                          [held, shown * unit, wide],
                          [np.zeros((more, size)), -own.b, own.a]]),
                np.block([[forward.b, tall], [ahead * unit, still], [wide.T, own.b]]),
                np.hstack([forward.c, -own.d, own.c]),
                np.hstack([forward.d, own.d]),
                np.vstack([tall, still, own.g]),
                np.block([[forward.rest, tall], [unit, still], [-own.rest, own.rest]]))

    def resting(self, wanted: Array, reading: Array) -> Array:
        """Make the memory of a plate that has rested at a place, where another one was wanted."""
        return np.asarray(self.parts[5] @ self._inputs(wanted, reading))

    def voltages(self, memory: Array, wanted: Array, reading: Array) -> tuple[Array, Array]:
        """Compute the segments' voltages [V] until the next sample, and the next memory.

        ``wanted`` are the places wanted at the next sample, ``reading`` those read now.
        """
        a, b, c, d, g, _ = self.parts
        inputs = self._inputs(wanted, reading)
        asked = c @ memory + d @ inputs
        known = np.clip(asked, -self.inverse.scale, self.inverse.scale)
        squared = self.inverse.squared(self.inverse.centre + known)
        given = np.clip(squared, 0.0, self.inverse.supply**2)
        missing = known - asked + self.slopes @ (given - squared)
        return np.sqrt(given), a @ memory + b @ inputs + g @ missing

    def _inputs(self, wanted: Array, reading: Array) -> Array:
        return np.concatenate([wanted, reading]) - np.tile(self.inverse.centre, 2)


@dataclass(frozen=True, eq=False)
class SteeredDesign:
    """A law, the plants that it was designed on, and its margins, the worst of them.

    ``inertia_off``: relative error of the plate's inertia for which it is as robust at the first.
    """

    law: SteeredLaw
    plants: tuple[SteeredLoop, ...]
    inertia_off: float

    @cached_property
    def margins(self) -> RunMargins:
        """Margins of each channel with the others closed; the largest singular sensitivity."""
        feedback, scale = self.law.feedback, self.law.inverse.scale
        assert feedback is not None
        omega = frequencies(self.plants, self.law.interval, _FREQUENCIES, fine=True)
        z = np.exp(1j * omega * self.law.interval)
        loops, largest = [], 0.0
        for plant in self.plants:
            found = sensitivities(plant.response(z), feedback.response(z), scale)
            largest = max(largest, float(np.linalg.norm(found, 2, axis=(1, 2)).max()))
            # With the others closed, the open loop L of a channel has 1/(1 + L) on the diagonal.
            loops += [1 / found[:, channel, channel] - 1 for channel in range(len(scale))]
        each = RunMargins.of(loops, omega)
        return RunMargins(each.gain, each.phase, each.delay, largest)


def design_law(model: SteeredModel, inverse: SteeredInverse, rests: Sequence[Array],
               interval: float, frequency: float, method: Method = "lqg",
               sensor_lag: float = 0.0) -> SteeredDesign:
    """Design a law about a motion of a frequency [Hz] that is robust at several rests.

    ``rests``: U² of the segments [V²] about which the model is linearised; the law is that of the
    first one. At all of them it must be stable, and its sensitivity bounded. Of LQG it is the one
    that is least sensitive beside the frequency, of PI the one of the largest integral gains.

    Raises
    ------
    Failure
        Where no law tried is stable and robust at all of them.
    """
    plants = tuple(SteeredLoop.of(model, squared, inverse, interval, sensor_lag)
                   for squared in rests)
    feedback, off = None, 0.0
    for off in _INERTIAS_OFF:
        others = [SteeredLoop.of(replace(model, mass=factor * model.mass), rests[0], inverse,
                                 interval, sensor_lag)
                  for factor in (1 - off, 1 + off) if off]
        feedback = _found([*plants, *others], [plants[0], *others], inverse.scale, interval,
                          frequency, method)
        if feedback is not None:
            break
    if feedback is None:
        raise Failure(f"no controller of this sampling and method, {method}, steers the film: "
                      "sample it more often (--interval), or choose the other --method")
    law = SteeredLaw(Forward.of(model, inverse, interval), feedback, interval, inverse,
                     model.linearise(rests[0]).gain, sensor_lag)
    return SteeredDesign(law, plants, off)


def _found(plants: Sequence[SteeredLoop], centres: Sequence[SteeredLoop], scale: Array,
           interval: float, frequency: float, method: Method) -> Feedback | None:
    """Find the feedback of a method; the swings of ``centres`` are looked at closely."""
    if method == "pi":
        return pi_by_channel(plants, scale, interval)
    tried = lqg_candidates(plants[0], scale, 2 * np.pi * frequency * interval)
    omega = np.append(frequencies(centres, interval), 2 * np.pi * _BESIDE * frequency)
    return _best(tried, plants, scale, np.exp(1j * omega * interval))


def _best(tried: Iterable[Feedback], plants: Sequence[SteeredLoop], scale: Array, z: Complex
          ) -> Feedback | None:
    """Choose the stable and robust feedback that is least sensitive at the last point z."""
    responses = [plant.response(z) for plant in plants]
    best, least = None, _HELPS
    for feedback in tried:
        own = feedback.response(z)
        sizes = np.array([np.linalg.norm(sensitivities(each, own, scale), 2, axis=(1, 2))
                          for each in responses])
        left = float(sizes[:, -1].max())
        if sizes.max() > SENSITIVITY or left >= least:
            continue
        if max(plant.largest_pole(feedback) for plant in plants) < 1:
            best, least = feedback, left
    return best
