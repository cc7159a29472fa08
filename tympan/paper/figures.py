"""The paper's figures 7–14 and Table 2 computed again with its lumped model and Table 1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.progress import Progress
from tympan.paper import published
from tympan.paper.missing_parameters import (
    MissingParameters,
    deflections,
    fit_levels,
    fit_rests,
)
from tympan.paper.published import MASSES, NAMES
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.linear import linearise
from tympan.studies.lumped.simulate import simulate
from tympan.studies.signals import Pieces, Sine, random_steps, step

Reading = Literal["rest", "levels"]

#: Voltages of figures 7 and 8 [V].
VOLTAGES = np.linspace(published.LOWEST, published.HIGHEST, 71)
#: The paper's sampling interval [s].
INTERVAL = 1e-3

#: End of the time axes of figures 9 to 12 [s]; the original is lost. Long enough for film creep.
_STEP_END = 30.0
#: End of the time axes of the zooms of figures 9 to 12 [s]; the original is lost, too.
ZOOM = 3.0

#: Smallest change that the paper's sensor resolves [m].
_SEEN = 1e-6
#: Error of responses [m], far below the sensor's resolution.
_PRECISION = 1e-10
#: Number of time spans in each of which a drawn response keeps the extremes.
_BUCKETS = 3000
#: Number of seeds that are tried for random levels near the lowest and highest voltage.
_SEEDS = 10_000
#: Usual thresholds of settling, as shares.
_USUAL = (0.05, 0.02, 0.01)


@dataclass(frozen=True)
class Choices:
    """Choices the paper leaves open: levels and seed of figure 14, period [s] of figure 13.

    Without a seed it is the first one whose levels come within ``near`` [V] of both of the paper's
    voltages; without a period see :func:`period_of`. ``reading`` is how Table 2 is read to find the
    missing ε_r and α₁: ``rest``, from 0 to 7 kV in equilibrium, or ``levels``, at the ends of
    figure 14's levels. Without a reading it is whichever fits better.
    """

    levels: int = 20
    seed: int | None = None
    period: float | None = None
    near: float = 100.0
    reading: Reading | None = None

    def __post_init__(self) -> None:
        if not 2 <= self.levels <= 200:
            raise InputError("must be from 2 to 200", key="--levels", given=self.levels)
        if self.seed is not None and not 0 <= self.seed < 2**63:
            raise InputError("must not be negative", key="--seed", given=self.seed)
        if self.period is not None and not 1e-2 <= self.period <= 1e5:
            raise InputError("must be from 10 ms to 1e5 s", key="--period",
                             given=f"{self.period:g} s")

    def steps(self) -> tuple[Pieces, int]:
        """Draw figure 14's random signal; return it with its seed."""
        for seed in (range(_SEEDS) if self.seed is None else (self.seed,)):
            signal = random_steps(published.LOWEST, published.HIGHEST, published.SWITCH,
                                  self.levels, seed)
            reached = max(float(signal.voltage.min()) - published.LOWEST,
                          published.HIGHEST - float(signal.voltage.max()))
            if self.seed is not None or reached <= self.near:
                return signal, seed
        raise InputError(f"with so few levels none of {_SEEDS} seeds comes within {self.near:g} V "
                         "of both ends", key="--levels", given=self.levels)


def thinned(time: Array, deflection: Array, whole_until: float = 0.0) -> tuple[Array, Array]:
    """Thin a response to the extremes in spans of time; all samples up to a time [s] stay."""
    keep = set(np.flatnonzero(time <= whole_until).tolist())
    for span in np.array_split(np.arange(len(time)), min(_BUCKETS, len(time))):
        keep |= {int(span[np.argmin(deflection[span])]), int(span[np.argmax(deflection[span])])}
    chosen = np.array(sorted(keep | {0, len(time) - 1}))
    return time[chosen], deflection[chosen]


@dataclass(frozen=True, eq=False)
class Decay:
    """Decay of an oscillation.

    ``height`` is half the distance [m] from one extreme to the next, ``time`` [s] is midway between
    them, ``travel`` [m] the change from the first sample to the last.
    """

    time: Array
    height: Array
    travel: float

    @property
    def scales(self) -> dict[str, float]:
        """Quantity [m] that a threshold is a share of, by the kind of criterion; 1 for a length."""
        return {"largest swing": float(self.height.max()), "whole change": self.travel,
                "length": 1.0}

    @classmethod
    def of(cls, time: Array, deflection: Array) -> Decay:
        """Find the decay in a sampled response to a step; parabolas refine its extremes."""
        turning = np.flatnonzero(np.diff(np.sign(np.diff(deflection))) != 0) + 1
        before, at, after = (deflection[turning + shift] for shift in (-1, 0, 1))
        bend = before - 2 * at + after
        shift = np.where(bend != 0, (before - after) / np.where(bend != 0, 2 * bend, 1.0), 0.0)
        heights = at - (before - after) * shift / 4
        places = time[turning] + shift * (time[1] - time[0])
        return cls((places[1:] + places[:-1]) / 2 - time[0], np.abs(np.diff(heights)) / 2,
                   float(abs(deflection[-1] - deflection[0])))

    def settled(self, threshold: float) -> float:
        """Find the time at which the oscillation last exceeds a threshold [m]; nan if never.

        It is interpolated on a logarithmic scale, as an oscillation decays.
        """
        large = np.flatnonzero(self.height > threshold)
        if not len(large):
            return float("nan")
        last = int(large[-1])
        if last + 1 == len(self.height):
            return float(self.time[last])
        (high, low), (before, after) = self.height[last:last + 2], self.time[last:last + 2]
        return float(before + (after - before) * np.log(high / threshold) / np.log(high / low))


@dataclass(frozen=True, eq=False)
class Criterion:
    """Settling times [s] by one kind of criterion at one threshold, shape (masses, actuators)."""

    kind: str
    threshold: float
    times: Array

    @property
    def rms(self) -> float:
        """Root mean square of the difference from the paper's [s]."""
        return float(np.sqrt(np.mean((self.times - published.SETTLING) ** 2)))


@dataclass(frozen=True, eq=False)
class Replica:
    """Figures 7–14 and Table 2. Lists are by mass and actuator, loops by signal and actuator.

    ``steps`` and ``random`` are thinned responses: times [s] and deflections [m]; ``loops`` are
    voltages [V] and deflections [m] of one period.
    """

    choices: Choices
    reading: Reading
    fits: dict[Reading, MissingParameters]
    static: Array
    steps: list[list[tuple[Array, Array]]]
    decays: list[list[Decay]]
    period: float
    loops: list[list[tuple[Array, Array]]]
    signal: Pieces
    seed: int
    random: list[list[tuple[Array, Array]]]
    level_ranges: Array

    @property
    def missing(self) -> MissingParameters:
        """The ε_r and α₁ with which all figures were computed."""
        return self.fits[self.reading]

    @property
    def rest_ranges(self) -> Array:
        """Ranges between the paper's voltages in equilibrium [m], shape (masses, actuators)."""
        return self.static[:, :, -1] - self.static[:, :, 0]

    @property
    def random_ranges(self) -> Array:
        """Ranges over figure 14's signal [m], shape (masses, actuators)."""
        return np.array([[np.ptp(deflection) for _, deflection in row] for row in self.random])


def period_of(actuator: Actuator) -> float:
    """Compute the period [s] of largest phase lag at the voltage of figure 13's right column.

    The slow part of the linear model has its slowest pole and a zero at k₁/η₁, the relaxation of
    the branches alone. Such a pair lags most at the geometric mean of both.
    """
    pole = float(np.abs(linearise(actuator, published.SINES[1][0]).poles[0]))
    zero = actuator.viscous.k1 / actuator.viscous.eta1
    return float(2 * np.pi / np.sqrt(pole * zero))


def run(choices: Choices = Choices(), progress: Progress = lambda _: None) -> Replica:
    """Compute everything; ``progress`` is called :data:`STEPS_OF_RUN` times."""
    progress("missing parameters from Table 2")
    signal, seed = choices.steps()
    fits: dict[Reading, MissingParameters] = {"rest": fit_rests(), "levels": fit_levels(signal)}
    better: Reading = "levels" if fits["levels"].rms < fits["rest"].rms else "rest"
    reading = choices.reading or better
    missing = fits[reading]
    models = [missing.actuators(mass) for mass in MASSES]
    progress("figures 7 and 8")
    static = deflections(missing.permittivity, missing.alpha, VOLTAGES[:, None, None])
    progress("figures 9 to 12")
    time, steps = _responses(models, step(*published.STEP, 0.0, _STEP_END))
    traces = [[thinned(time, y, ZOOM) for y in row] for row in steps]
    decays = [[Decay.of(time, y) for y in row] for row in steps]
    period = choices.period or period_of(models[0][0])
    loops: list[list[tuple[Array, Array]]] = [[] for _ in published.SINES]
    for row, sine in zip(loops, published.SINES, strict=True):
        for model in models[0]:
            progress(f"figure 13: {model.specimen.name} about {1e-3 * sine[0]:g} kV")
            response = simulate(model, Sine(*sine, period), precision=_PRECISION)
            row.append(tuple(response.last_loop(period).to_numpy().T))
    progress("figure 14")
    time, random = _responses(models, signal)
    ends = np.searchsorted(time, signal.breaks - INTERVAL / 2)
    return Replica(choices, reading, fits, np.moveaxis(static, 0, -1), traces, decays, period,
                   loops, signal, seed, [[thinned(time, y) for y in row] for row in random],
                   np.ptp(random[..., ends], axis=-1))


#: Number of times that :func:`run` calls ``progress``.
STEPS_OF_RUN = 4 + len(published.SINES) * len(NAMES)


def _responses(models: list[tuple[Actuator, ...]], signal: Pieces) -> tuple[Array, Array]:
    """Simulate from equilibrium: times [s], deflections [m] of shape (masses, actuators, times)."""
    time = np.arange(0.0, signal.end + INTERVAL / 2, INTERVAL)
    responses = [[simulate(model, signal, precision=_PRECISION) for model in row]
                 for row in models]
    if any(response.stopped is not None for row in responses for response in row):
        raise InputError("one of the films is drawn in: a step overshoots what a slow ramp may "
                         "reach; lower the voltage", key="signal",
                         given=f"{signal.peak / 1e3:g} kV")
    return time, np.array([[response.deflection(time) for response in row] for row in responses])


def criteria(decays: list[list[Decay]]) -> list[Criterion]:
    """List settling times by usual thresholds, the sensor's, and the best one of each kind."""
    kinds = decays[0][0].scales
    return [*(settling_times(decays, kind, share) for kind in ("largest swing", "whole change")
              for share in _USUAL), settling_times(decays, "length", _SEEN),
            *(nearest(decays, kind) for kind in kinds)]


def settling_times(decays: list[list[Decay]], kind: str, threshold: float) -> Criterion:
    """Compute settling times by one criterion, for responses by mass and actuator."""
    return Criterion(kind, threshold, np.array(
        [[decay.settled(threshold * decay.scales[kind]) for decay in row] for row in decays]))


def nearest(decays: list[list[Decay]], kind: str) -> Criterion:
    """Find the threshold of a kind whose six settling times are nearest to the paper's."""
    every = [decay for row in decays for decay in row]
    largest = min(decay.height.max() / decay.scales[kind] for decay in every)
    smallest = max(decay.height.min() / decay.scales[kind] for decay in every)
    thresholds = np.geomspace(largest, smallest, 402)[1:-1]
    return min((settling_times(decays, kind, threshold) for threshold in thresholds),
               key=lambda criterion: criterion.rms)
