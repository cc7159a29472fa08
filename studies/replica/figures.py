"""The paper's figures 7–14 and Table 2 computed again with its lumped model and Table 1."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.studies.files import write_csv
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.linear import linearise
from tympan.studies.lumped.signals import Pieces, Sine, random_steps, step
from tympan.studies.lumped.simulate import Loop, last_loop, simulate
from tympan.studies.paper import published
from tympan.studies.paper.published import MASSES, NAMES
from tympan.studies.replica import settling
from tympan.studies.replica.missing_from_levels import fit_levels
from tympan.studies.replica.missing_parameters import (
    MissingParameters,
    allowed,
    deflections,
    fit,
    smallest_worst,
    worst_misfit,
)
from tympan.studies.replica.settling import Criterion, Decay

Array = NDArray[np.float64]
Progress = Callable[[str], None]
Reading = Literal["rest", "levels"]

#: The paper's sampling interval [s].
INTERVAL = 1e-3
_STEP_END, ZOOM = 30.0, 3.0  # [s]; the time axes of figures 9–12 are lost
_PRECISION = 1e-10  # of responses [m]; the sensor sees 1 µm
_BUCKETS = 3000
_SEEDS = 10_000


@dataclass(frozen=True)
class Choices:
    """What the paper leaves open: figure 14's levels and seed, figure 13's period [s]; None: found.

    ``near`` [V]: without a seed the first one whose levels come so near to both of the paper's
    voltages is taken. ``reading`` is how Table 2 is read to find the missing ε_r and α₁: ``rest``,
    from 0 to 7 kV at rest, or ``levels``, at the ends of figure 14's levels; None: whichever fits
    it better.
    """

    levels: int = 20
    seed: int | None = None
    period: float | None = None
    near: float = 100.0
    reading: Reading | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be simulated."""
        if not 2 <= self.levels <= 200:
            raise InputError("must be from 2 to 200", key="--levels", given=self.levels)
        if self.seed is not None and not 0 <= self.seed < 2**63:
            raise InputError("must not be negative", key="--seed", given=self.seed)
        if self.period is not None and not 1e-2 <= self.period <= 1e5:
            raise InputError("must be from 10 ms to 1e5 s", key="--period",
                             given=f"{self.period:g} s")

    def steps(self) -> tuple[Pieces, int]:
        """Figure 14's signal and its seed.

        Raises
        ------
        InputError
            When so few levels come near to both voltages with no seed that was tried.
        """
        for seed in (range(_SEEDS) if self.seed is None else (self.seed,)):
            signal = random_steps(published.LOWEST, published.HIGHEST, published.SWITCH,
                                  self.levels, seed)
            reached = max(float(signal.voltage.min()) - published.LOWEST,
                          published.HIGHEST - float(signal.voltage.max()))
            if self.seed is not None or reached <= self.near:
                return signal, seed
        raise InputError(f"with so few levels none of {_SEEDS} seeds comes within "
                         f"{self.near:g} V of both ends",
                         key="--levels", given=self.levels)


@dataclass(frozen=True, eq=False)
class Trace:
    """A response to draw: of each span of time its least and largest deflection [m]."""

    time: Array
    deflection: Array
    lowest: float
    highest: float

    @classmethod
    def of(cls, time: Array, deflection: Array, whole_until: float = 0.0) -> Trace:
        """Of a sampled response; every sample is kept up to a time [s]."""
        keep = set(np.flatnonzero(time <= whole_until).tolist())
        for span in np.array_split(np.arange(len(time)), min(_BUCKETS, len(time))):
            keep |= {int(span[np.argmin(deflection[span])]), int(span[np.argmax(deflection[span])])}
        chosen = np.array(sorted(keep | {0, len(time) - 1}))
        return cls(time[chosen], deflection[chosen], float(deflection.min()),
                   float(deflection.max()))

    @property
    def range(self) -> float:
        """Largest less smallest deflection of all samples [m]."""
        return self.highest - self.lowest


@dataclass(frozen=True, eq=False)
class Replica:
    """Figures 7–14 and Table 2; lists are by mass and actuator, loops by signal and actuator."""

    reading: Reading
    fits: dict[Reading, MissingParameters]
    others: dict[str, MissingParameters]
    smallest_worst: MissingParameters
    allowed: dict[str, tuple[float, float]]
    worst: tuple[Array, Array, Array]
    voltages: Array
    static: Array
    steps: list[list[Trace]]
    decays: list[list[Decay]]
    poles: NDArray[np.complex128]
    period: float
    loops: list[list[Loop]]
    signal: Pieces
    seed: int
    random: list[list[Trace]]
    level_ranges: Array

    @property
    def missing(self) -> MissingParameters:
        """The ε_r and α₁ everything was computed with."""
        return self.fits[self.reading]

    @property
    def rest_ranges(self) -> Array:
        """Between the paper's voltages at rest [m], shape (masses, actuators)."""
        return np.asarray(self.static[:, :, -1] - self.static[:, :, 0])

    @property
    def random_ranges(self) -> Array:
        """Over figure 14's signal [m], shape (masses, actuators)."""
        return np.array([[one.range for one in row] for row in self.random])

    @cached_property
    def criteria(self) -> list[Criterion]:
        """Settling times by usual criteria, what the sensor sees, and the nearest of each kind."""
        usual = [settling.settling_times(self.decays, kind, share) for kind in settling.KINDS
                 if kind != "length"
                 for share in settling.USUAL]
        return [*usual, settling.settling_times(self.decays, "length", 1e-6),
                *(settling.nearest(self.decays, kind) for kind in settling.KINDS)]


def period_of(actuator: Actuator) -> float:
    """The period [s] at which the actuator lags most about the voltage of figure 13's right column.

    The slow part of the linear model is a pole, the slowest, and a zero at k₁/η₁, where the
    branches alone relax; such a pair lags most at the geometric mean of the two.
    """
    pole = float(np.abs(linearise(actuator, published.SINES[1][0]).poles[0]))
    zero = actuator.viscous.k1 / actuator.viscous.eta1
    return float(2 * np.pi / np.sqrt(pole * zero))


def run(choices: Choices = Choices(), progress: Progress = lambda _: None) -> Replica:
    """Compute everything; ``progress`` is called :data:`STEPS_OF_RUN` times.

    Raises
    ------
    InputError
        When figure 14's levels cannot reach both voltages, or one of them is beyond pull-in.
    """
    progress("missing parameters from Table 2")
    signal, seed = choices.steps()
    fits: dict[Reading, MissingParameters] = {"rest": fit(), "levels": fit_levels(signal)}
    better: Reading = "levels" if fits["levels"].rms < fits["rest"].rms else "rest"
    reading = choices.reading or better
    missing = fits[reading]
    others = {"one alpha for each ellipse": fit(shared=False),
              **{f"{1e3 * mass:g} g alone": fit(rows=(row,)) for row, mass in enumerate(MASSES)}}
    permittivities, alphas = np.linspace(7.0, 10.0, 61), np.linspace(0.0, 1.0, 41)
    map_ = permittivities, alphas, worst_misfit(permittivities, alphas)
    limits, best = allowed(), smallest_worst()
    models = [missing.actuators(mass) for mass in MASSES]
    progress("figures 7 and 8")
    voltages = np.linspace(published.LOWEST, published.HIGHEST, 71)
    static = deflections(missing.permittivity, missing.alpha, voltages[:, None, None])
    progress("figures 9 to 12")
    time, steps = _responses(models, step(*published.STEP, 0.0, _STEP_END))
    traces = [[Trace.of(time, y, ZOOM) for y in row] for row in steps]
    decays = [[Decay.of(time, y) for y in row] for row in steps]
    period = choices.period or period_of(models[0][0])
    loops = [[_loop(model, Sine(*sine, period), progress) for model in models[0]]
             for sine in published.SINES]
    progress("figure 14")
    time, random = _responses(models, signal)
    ends = np.searchsorted(time, signal.breaks - INTERVAL / 2)
    poles = np.array([[linearise(model, published.STEP[1]).poles[-1] for model in row]
                      for row in models])
    return Replica(reading, fits, others, best, limits, map_, voltages,
                   np.moveaxis(static, 0, -1), traces, decays, poles, period, loops, signal, seed,
                   [[Trace.of(time, y) for y in row] for row in random],
                   np.ptp(random[..., ends], axis=-1))


#: How often :func:`run` calls ``progress``.
STEPS_OF_RUN = 4 + len(published.SINES) * len(NAMES)


def _responses(models: list[tuple[Actuator, ...]], signal: Pieces) -> tuple[Array, Array]:
    """Times [s] and deflections [m], shape (masses, actuators, times), from rest.

    Raises
    ------
    InputError
        When a film is drawn in.
    """
    time = np.arange(0.0, signal.end + INTERVAL / 2, INTERVAL)
    responses = [[simulate(model, signal, precision=_PRECISION) for model in row]
                 for row in models]
    if any(response.drawn_in is not None for row in responses for response in row):
        raise InputError("one of the films is drawn in: a step overshoots what a slow ramp may "
                         "reach; lower the voltage", key="signal",
                         given=f"{signal.peak / 1e3:g} kV")
    return time, np.array([[response.deflection(time) for response in row] for row in responses])


def _loop(model: Actuator, signal: Sine, progress: Progress) -> Loop:
    progress(f"figure 13: {model.specimen.name} about {1e-3 * signal.offset:g} kV")
    return last_loop(simulate(model, signal, precision=_PRECISION), signal.period)


def write_curves(found: Replica, folder: Path) -> None:
    """The curves as CSV files, from which the figures are drawn."""
    names = [(f"{1e3 * mass:g}", name) for mass in MASSES for name in NAMES]
    write_csv(folder / "static.csv", ("mass_g", "specimen", "voltage_kV", "distance_mm"),
              ((*name, 1e-3 * volts, 1e3 * y)
               for name, column in zip(names, found.static.reshape(6, -1), strict=True)
               for volts, y in zip(found.voltages.tolist(), column.tolist(), strict=True)))
    for stem, traces in (("step", found.steps), ("random", found.random)):
        write_csv(folder / f"{stem}.csv", ("mass_g", "specimen", "t_s", "distance_mm"),
                  _rows(names, traces))
    write_csv(folder / "hysteresis.csv",
              ("offset_kV", "amplitude_kV", "specimen", "voltage_kV", "distance_mm"),
              ((1e-3 * sine[0], 1e-3 * sine[1], name, 1e-3 * volts, 1e3 * y)
               for sine, row in zip(published.SINES, found.loops, strict=True)
               for name, loop in zip(NAMES, row, strict=True)
               for volts, y in zip(loop.voltage.tolist(), loop.deflection.tolist(), strict=True)))
    write_csv(folder / "signal.csv", ("t_s", "voltage_kV"),
              zip(found.signal.time.tolist(), (1e-3 * found.signal.voltage).tolist(), strict=True))
    permittivity, alpha, worst = found.worst
    write_csv(folder / "misfit.csv", ("relative_permittivity", "alpha_1", "worst_mm"),
              ((one, other, "" if np.isnan(worst[i, j]) else 1e3 * float(worst[i, j]))
               for i, one in enumerate(permittivity.tolist())
               for j, other in enumerate(alpha.tolist())))


def _rows(names: list[tuple[str, str]], traces: list[list[Trace]]) -> Iterator[tuple[Any, ...]]:
    for name, trace in zip(names, (one for row in traces for one in row), strict=True):
        for t, y in zip(trace.time.tolist(), trace.deflection.tolist(), strict=True):
            yield (*name, t, 1e3 * y)
