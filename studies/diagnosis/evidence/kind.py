"""Interface of a kind of evidence, and the prepared readings of a dataset."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from tympan.base.arrays import Array, Mask, Numbers
from tympan.base.errors import InputError
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.hypothesis import (
    FACTORS,
    Cause,
    Hypothesis,
    uses_of,
    with_factors,
)
from tympan.studies.diagnosis.patterns.reading_patterns import patterns
from tympan.studies.diagnosis.reading_table import ReadingTable, Unit
from tympan.studies.effects import EFFECTS, Setup, Use, extended
from tympan.studies.effects.effect import Observable

#: Noise of a displacement that is neither stated nor measured, as a share of the readings. No
#: source.
ASSUMED = 0.02
#: Noise of other channels whose noise no file states, as a share of the readings. No source.
CHANNEL = 0.01
#: Fewest readings for a conclusion: stiffness, permittivity and noise take three.
FEWEST = 5

#: A held-out split: its kind, such as "shape" or "mode", its name, and the rows.
Split = tuple[str, str, Mask]


class Shown(Protocol):
    """Predicted readings of rows at some unknowns, with derivatives.

    ``possible``: whether each state has an equilibrium; ``short``: whether it might have one with
    laws that reach further; ``deflection``: of each state [m]. ``values``, (rows,), are nan
    without an equilibrium, ``extended`` continues smoothly there; ``jacobian`` holds its
    derivatives by the unknowns, (rows, unknowns).
    """

    @property
    def possible(self) -> Mask: ...
    @property
    def short(self) -> Mask: ...
    @property
    def deflection(self) -> Array: ...
    @property
    def complete(self) -> bool: ...
    @property
    def extended(self) -> Array: ...
    @property
    def values(self) -> Array: ...
    @property
    def jacobian(self) -> Array: ...
    def beyond(self, before: Any) -> bool: ...


class Predicts(Protocol):
    """Predictions with derivatives, and the ranges of unknowns: all that a fit needs."""

    def prediction(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Shown:
        """Predict the readings of the rows of a table, with derivatives."""

    def bounds(self, hypothesis: Hypothesis) -> Array:
        """Give the smallest and largest unknowns, (2, unknowns), for which films are sampled."""

    def limits(self, hypothesis: Hypothesis) -> Array:
        """Give the limits of unknowns for which films could be sampled, as far as known."""


class ReadingModel(ABC):
    """A model that predicts readings under hypotheses: the films of a ``setup``, or strips.

    ``evidence``: the kinds of readings that it predicts. Growing returns the same object where
    nothing changes.
    """

    setup: Setup
    evidence: tuple[Evidence, ...]

    @abstractmethod
    def prediction(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Shown:
        """Predict the readings of the rows of a table, with derivatives."""

    @abstractmethod
    def bounds(self, hypothesis: Hypothesis) -> Array:
        """Give the smallest and largest unknowns, (2, unknowns), for which films are sampled."""

    @abstractmethod
    def limits(self, hypothesis: Hypothesis) -> Array:
        """Give the smallest and largest unknowns that sampling could reach, as far as known."""

    @abstractmethod
    def of_first(self) -> ReadingModel:
        """Restrict the model to the first kind of evidence, and kinds loaded in the same way."""

    @abstractmethod
    def grown(self, cause: Cause, index: int, side: int, workers: int = 1) -> ReadingModel:
        """Extend the model to a larger size of an effect's parameter, on side +1 or -1."""

    @abstractmethod
    def refined(self, hypothesis: Hypothesis, unknowns: Array, workers: int = 1) -> ReadingModel:
        """Refine the model so that it is exact at the sizes of a hypothesis' unknowns."""

    @abstractmethod
    def coupled(self, hypotheses: Sequence[Hypothesis], unknowns: Sequence[Array],
                workers: int = 1) -> ReadingModel:
        """Add the joint influence of every two parameters to the model."""

    @abstractmethod
    def further(self, workers: int = 1) -> ReadingModel:
        """Extend the model to larger deflections and voltages, where the films have them."""

    @property
    def loaded(self) -> bool:
        """Whether all readings are of plates under loads."""
        return all(kind.loaded for kind in self.evidence)

    def predict(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Array:
        """Predict the reading of each row of a table, nan without an equilibrium."""
        return self.prediction(hypothesis, unknowns, table).values

    def extended(self, hypothesis: Hypothesis, unknowns: Array) -> Setup:
        """Apply stiffness, permittivity and effects to the setup."""
        return self.evidence[0].extended(self.setup, unknowns, uses_of(hypothesis, unknowns))


class Evidence(Protocol):
    """Readings of one kind.

    ``files``: those that they are written in; ``kinds``: those of the rows that it predicts.
    ``loaded``: whether they are of plates under loads. Only then may labels be exchanged, may other
    loads add information, and can the films be shown.
    """

    files: ClassVar[tuple[str, ...]]
    kinds: ClassVar[tuple[str, ...]]
    loaded: ClassVar[bool] = False

    def patterns(self, table: ReadingTable, names: Sequence[str], predicted: Array
                 ) -> dict[str, Array]:
        """Build columns by name whose combination may be a misfit of rows, all of this kind."""

    def splits(self, setup: Setup, table: ReadingTable
               ) -> tuple[list[Split], dict[str, Array]]:
        """Build splits that hold out rows, and for each kind the level of each row, (rows,)."""
        return [], {}

    def observables(self, table: ReadingTable) -> set[Observable]:
        """Find the observables in its rows, among those that alone reveal some effects."""
        return set()

    def feels(self, cause: Cause, setup: Setup, table: ReadingTable) -> bool:
        """Check whether an effect can change anything that its rows depend on."""
        return True

    def extended(self, setup: Setup, unknowns: Array, uses: Iterable[Use]) -> Setup:
        """Apply the factors on stiffness and permittivity to the setup, then effects."""
        factors = np.exp(unknowns[FACTORS]).tolist()
        return extended(setup.with_films(lambda film: with_factors(film, *factors)), uses)

    def written(self, table: ReadingTable, names: Sequence[str], models: Mapping[str, Array]
                ) -> Mapping[str, Array] | None:
        """Build the columns of its own file, with the models' values; None without such a file."""
        return None

    def specimens(self, setup: Setup) -> tuple[Specimen, ...]:
        """Select the specimens that get a file."""
        return setup.specimens

    def wrote(self, files: NDArray[np.str_]) -> Mask:
        """Mark the names of files that are of this kind, whatever their format."""
        stems = [name.partition(".")[0] for name in files.tolist()]
        return np.isin(np.array(stems, str), [Path(name).stem for name in self.files])


@runtime_checkable
class StripEvidence(Evidence, Protocol):
    """Readings of films that no plate loads; this evidence predicts them itself."""

    def predict(self, model: Predicts, hypothesis: Hypothesis, unknowns: Array,
                table: ReadingTable) -> Shown:
        """Predict the readings of a table's rows, all of this kind."""


class FilmsUnderLoads(Protocol):
    """Films under loads as kinds of evidence see them; values of every state, shape (states,).

    ``behind``: share of the last jump by which the reading lags; ``moving``: mass that moves with
    the plate [kg]. At deflections [m]: ``capacitance`` [F]; ``tilt``, its size [rad]; ``slope``
    of the plate along x (0) or y (1); ``segment_capacitance`` at the lead of a segment [F];
    ``force`` that holds the plate [N]; ``stiffness`` of film and rig [N/m]; ``swing``: complex
    stiffness of an oscillating plate over that; ``scanned``: displacements at the places of a scan,
    by its number, in one state [m], shape (3, places).
    """

    @property
    def table(self) -> ReadingTable: ...
    @property
    def rig(self) -> Rig: ...
    @property
    def behind(self) -> Array: ...
    @property
    def moving(self) -> Array: ...
    def capacitance(self, deflection: Array) -> Array: ...
    def tilt(self, deflection: Array) -> Array: ...
    def slope(self, axis: int, deflection: Array) -> Array: ...
    def segment_capacitance(self, specimen: int, segment: int, deflection: Array) -> Array: ...
    def force(self, deflection: Array) -> Array: ...
    def stiffness(self, deflection: Array) -> Array: ...
    def swing(self, stiffness: Array) -> Array: ...
    def scanned(self, number: int, state: int, deflection: Array) -> Array: ...


class PlateEvidence(Evidence, Protocol):
    """Readings of plates under loads.

    ``alone``: without other readings they separate a mass from a stiffness. ``noisy``: their rows
    come with their noise, and are neither averaged nor rounded. ``units``: those of kinds of rows
    that :mod:`~tympan.studies.diagnosis.reading_table` does not know. The columns of its ``files``
    are declared in :data:`tympan.studies.data.dataset.FILES`.
    """

    units: ClassVar[Mapping[str, Unit]] = {}
    loaded: ClassVar[bool] = True
    alone: ClassVar[bool] = False
    noisy: ClassVar[bool] = False

    def read(self, dataset: Dataset, setup: Setup) -> tuple[list[ReadingTable], list[str]]:
        """Read the rows of its files for a setup's specimens; say what was done to the readings.

        A standard deviation that is not stated is nan.
        """
        return [], []

    def shown(self, films: FilmsUnderLoads, kind: str, rows: Numbers, deflection: Array) -> Array:
        """Predict readings of rows of one of its kinds at these deflections of states [m]."""

    def patterns(self, table: ReadingTable, names: Sequence[str], predicted: Array
                 ) -> dict[str, Array]:
        return patterns(table, names, predicted)


def numbers_of(setup: Setup, names: NDArray[np.str_]) -> list[int]:
    """Find the numbers of specimens with these names."""
    numbers = {specimen.name: number for number, specimen in enumerate(setup.specimens)}
    return [numbers[name] for name in names.tolist()]


def rows_of_kinds(evidence: Sequence[Evidence], table: ReadingTable) -> Mask:
    """Mark the rows of a table that belong to some kinds of evidence."""
    return np.isin(table.kind, [name for kind in evidence for name in kind.kinds])


@dataclass(frozen=True, eq=False)
class PreparedReadings:
    """The setup with the specimens that were read, the table, and its kinds of evidence.

    ``remarks`` say what was done to the readings. ``coupons``: readings of coupons of the same
    film, weighed with these.
    """

    setup: Setup
    table: ReadingTable
    evidence: tuple[Evidence, ...]
    remarks: tuple[str, ...] = ()
    coupons: PreparedReadings | None = None

    @property
    def assumed(self) -> bool:
        """Whether the noise is only assumed."""
        return self.table.noise.source == "assumed"

    @property
    def observables(self) -> set[Observable]:
        """Observables that are read, among those that alone reveal some effects."""
        return set().union(*(kind.observables(self.table) for kind in self.evidence))

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Effects that these readings could show."""
        others, read = () if self.coupons is None else self.coupons.causes, self.observables
        return tuple(cause for name, effect in EFFECTS.items()
                     for cause in (Cause(name, which) for which in effect.choices(self.setup))
                     if cause in others or (effect.shown_by(read) and all(
                         kind.feels(cause, self.setup, self.table) for kind in self.evidence)
                         and _has_place(cause, self.setup)))


def _has_place(cause: Cause, setup: Setup) -> bool:
    """Check whether a setup has what an effect acts on: some act on a plate, or on a sector."""
    sizes = [parameter.deviation for parameter in cause.effect.parameters]
    try:
        edited = cause.effect.at(setup, sizes, cause.which)
    except InputError as error:
        return error.key not in ("plate", "electrode.segment")
    if any(specimen.plate is not None for specimen in setup.specimens):
        return True
    try:
        edited.rig.require_no_plate_loads()
    except InputError:
        return False
    return True
