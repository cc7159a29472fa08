"""A bench whose readings are straight in all that is unknown: a verdict takes a tenth of a second.

Its films are none: a plate deflects in proportion to its load, and by a share more with the square
of the voltage. Effects have the names and priors of the library's; what each does at its usual size
is a curve below. The judgement asks no more of a model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.fem.rig import Rig
from tympan.studies.diagnosis.evidence.kind import Evidence, ReadingModel, Shown
from tympan.studies.diagnosis.evidence.registry import REST
from tympan.studies.diagnosis.fits.first_order import FitTangent
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis, parameters_of
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.effects import Setup
from tympan.studies.shipped import actuators

#: Noise of a reading [m].
SIGMA = 10e-6
#: The largest voltage [V], and the masses [kg].
HIGHEST, MASSES = 6.5e3, (17.9e-3, 22.45e-3)
#: Deflection of each specimen under a gram [m], and how much more of it the largest voltage makes.
SOFTNESS, RISES = np.array([0.12e-3, 0.10e-3, 0.08e-3]), np.array([0.9, 0.7, 0.5])


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a table: specimen, mass, U² and time over their largest, and the deflection [m]."""

    specimen: Numbers
    load: Array
    squared: Array
    time: Array
    deflection: Array

    @classmethod
    def of(cls, table: ReadingTable) -> Rows:
        squared = (table.voltage / HIGHEST) ** 2
        elapsed = table.states.elapsed[table.state]
        deflection = 1e3 * table.mass * SOFTNESS[table.specimen] * (
            1 + RISES[table.specimen] * squared)
        return cls(table.specimen, table.mass / max(MASSES), squared, elapsed / 3600.0, deflection)


#: What an effect of the usual size adds to readings [m].
DOES: dict[str, Callable[[Rows], Array]] = {
    "sensor_zero": lambda rows: np.full(len(rows.load), 60e-6),
    "drift": lambda rows: 60e-6 * rows.time,
    "unaccounted_mass": lambda rows: 0.1 * rows.deflection / rows.load,
    "voltage_sag": lambda rows: -0.3 * rows.deflection * rows.squared**2,
    "parallel_spring": lambda rows: -40.0 * rows.deflection**2,
    "strain_stiffening": lambda rows: -2e4 * rows.deflection**3,
    "prestretch_loss": lambda rows: 0.1 * rows.deflection,
    # Two that do the same, and one that stiffness makes up for.
    "hysteresis": lambda rows: 60e-6 * rows.squared * rows.load,
    "electrode_margin": lambda rows: 61e-6 * rows.squared * rows.load,
    "sensor_gain": lambda rows: 0.1 * rows.deflection,
}


@dataclass(frozen=True, eq=False)
class StraightBench(ReadingModel):
    """The model; ``sampled``: the largest size of an effect, over its usual one."""

    setup: Setup = field(default_factory=lambda: Setup(actuators(), Rig()))
    evidence: tuple[Evidence, ...] = (REST,)
    sampled: float = 100.0

    def prediction(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Shown:
        there = Rows.of(table)
        rise = there.deflection * (1 - 1 / (1 + RISES[there.specimen] * there.squared))
        columns = [-there.deflection, rise, *(column for cause in hypothesis
                                              for column in self._columns(cause, there))]
        return FitTangent(np.zeros(len(columns)), there.deflection, np.stack(columns, 1), unknowns,
                       np.zeros(len(table.states)), 0.0)

    def _columns(self, cause: Cause, there: Rows) -> list[Array]:
        names = [specimen.name for specimen in self.setup.specimens]
        does = DOES[cause.name](there)
        if cause.which is not None:
            does = np.where(there.specimen == names.index(cause.which), does, 0.0)
        first, *others = cause.effect.parameters
        return [does / first.deviation, *(0.0 * does for _ in others)]

    def bounds(self, hypothesis: Hypothesis) -> Array:
        ends = [np.clip([-self.sampled * item.deviation, self.sampled * item.deviation],
                        *item.limits) for item in parameters_of(hypothesis)]
        return np.array([(-3.0, 3.0), (-3.0, 3.0), *ends]).T

    def limits(self, hypothesis: Hypothesis) -> Array:
        return self.bounds(hypothesis)

    def of_first(self) -> StraightBench:
        return self

    def grown(self, cause: Cause, index: int, side: int, workers: int = 1) -> StraightBench:
        return self

    def refined(self, hypothesis: Hypothesis, unknowns: Array, workers: int = 1) -> StraightBench:
        return self

    def coupled(self, hypotheses: Sequence[Hypothesis], unknowns: Sequence[Array],
                workers: int = 1) -> StraightBench:
        return self

    def further(self, workers: int = 1) -> StraightBench:
        return self


def design(voltages: int = 7, sigma: float = SIGMA, masses: tuple[float, ...] = MASSES
           ) -> ReadingTable:
    """Deflections of every specimen under every mass at some voltages, a minute each."""
    grid = np.meshgrid(np.arange(3), masses, np.linspace(0, HIGHEST, voltages), indexing="ij")
    specimen, mass, voltage = (axis.ravel() for axis in grid)
    elapsed = 60.0 * np.arange(len(mass))
    return rows(States.of(specimen.astype(np.int64), mass, voltage, elapsed), "displacement", sigma)


def readings(sizes: dict[Cause, float], table: ReadingTable | None = None, seed: int = 0,
             noise: float = 1.0, factors: tuple[float, float] = (0.05, -0.03)) -> ReadingTable:
    """A table read on the bench, with effects of so many usual sizes.

    ``noise``: of the readings over the one stated; ``factors``: logarithms of those on stiffness
    and permittivity.
    """
    table = design() if table is None else table
    hypothesis = tuple(sizes)
    unknowns = np.array([*factors, *(
        size * cause.effect.parameters[0].deviation if number == 0 else 0.0
        for cause, size in sizes.items()
        for number, _ in enumerate(cause.effect.parameters))])
    values = StraightBench().predict(hypothesis, unknowns, table)
    scatter = np.random.default_rng(seed).standard_normal(len(table))
    return table.with_values(values + noise * table.sigma * scatter)
