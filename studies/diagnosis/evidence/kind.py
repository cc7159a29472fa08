"""Interface of a kind of evidence, and the readings of a dataset that it makes."""

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
from tympan.studies.columns import Column
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

#: Noise of a displacement that nobody states and nothing measures, as a share of the readings. No
#: source.
ASSUMED = 0.02
#: Noise of what no file states the noise of, as a share of the readings. No source.
CHANNEL = 0.01
#: Readings below which nothing is concluded: stiffness, permittivity and noise take three.
FEWEST = 5

#: What is held out: its kind, such as "shape" or "mode", its name, and the rows.
Split = tuple[str, str, Mask]


class Shown(Protocol):
    """Predicted readings of rows at some unknowns, with derivatives.

    ``possible``: of each state whether it is one of equilibrium, ``short``: it might be by laws of
    further reach; ``heave``: of each [m]. ``values``, (rows,), are nan without an equilibrium,
    ``extended`` goes on there; ``jacobian`` is of these by the unknowns, (rows, unknowns).
    """

    @property
    def possible(self) -> Mask: ...
    @property
    def short(self) -> Mask: ...
    @property
    def heave(self) -> Array: ...
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
    """Predictions with derivatives, and how far unknowns may go: all that a fit asks for."""

    def prediction(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Shown:
        """Predicted readings of the rows of a table, with derivatives."""

    def bounds(self, hypothesis: Hypothesis) -> Array:
        """Smallest and largest unknowns, shape (2, unknowns), for which films are sampled."""

    def limits(self, hypothesis: Hypothesis) -> Array:
        """The same for which they could be, as far as known."""


class ReadingModel(ABC):
    """Whatever says what readings show under hypotheses: the films of a ``setup``, or strips.

    ``evidence``: the kinds of readings that it shows. A model that is grown is the same object
    where nothing changes.
    """

    setup: Setup
    evidence: tuple[Evidence, ...]

    @abstractmethod
    def prediction(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Shown:
        """Predicted readings of the rows of a table, with derivatives."""

    @abstractmethod
    def bounds(self, hypothesis: Hypothesis) -> Array:
        """Smallest and largest unknowns, shape (2, unknowns), for which films are sampled."""

    @abstractmethod
    def limits(self, hypothesis: Hypothesis) -> Array:
        """Smallest and largest unknowns for which films could be sampled, as far as known."""

    @abstractmethod
    def of_first(self) -> ReadingModel:
        """Model of the first kind of evidence, and of those that are loaded as it is."""

    @abstractmethod
    def grown(self, cause: Cause, index: int, side: int, workers: int = 1) -> ReadingModel:
        """Model with a larger size of an effect's parameter, on side +1 or -1."""

    @abstractmethod
    def refined(self, hypothesis: Hypothesis, unknowns: Array, workers: int = 1) -> ReadingModel:
        """Model that is exact at the sizes of a hypothesis' unknowns."""

    @abstractmethod
    def coupled(self, hypotheses: Sequence[Hypothesis], unknowns: Sequence[Array],
                workers: int = 1) -> ReadingModel:
        """Model with what every two parameters add to each other."""

    @abstractmethod
    def further(self, workers: int = 1) -> ReadingModel:
        """Model with larger deflections and voltages, where the films have them."""

    @property
    def loaded(self) -> bool:
        """Whether all that is read is of plates under loads."""
        return all(kind.loaded for kind in self.evidence)

    def predict(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Array:
        """Predicted reading of each row of a table, nan without an equilibrium."""
        return self.prediction(hypothesis, unknowns, table).values

    def extended(self, hypothesis: Hypothesis, unknowns: Array) -> Setup:
        """The setup with stiffness, permittivity and effects."""
        return self.evidence[0].extended(self.setup, unknowns, uses_of(hypothesis, unknowns))


class Evidence(Protocol):
    """Readings of one kind.

    ``files`` are those they are written in, ``kinds`` those of the rows whose prediction is theirs.
    ``loaded``: they are of plates under loads, whose labels may be exchanged, which other loads may
    tell more of, and whose films can be shown.
    """

    files: ClassVar[tuple[str, ...]]
    kinds: ClassVar[tuple[str, ...]]
    loaded: ClassVar[bool] = False

    def patterns(self, table: ReadingTable, names: Sequence[str], predicted: Array
                 ) -> dict[str, Array]:
        """Columns by name; a misfit of rows, all of this kind, may be a combination of them."""

    def splits(self, setup: Setup, table: ReadingTable
               ) -> tuple[list[Split], dict[str, Array]]:
        """Splits that hold out rows; and by kind of split the level of each row, shape (rows,)."""
        return [], {}

    def observables(self, table: ReadingTable) -> set[Observable]:
        """Observables that its rows read, of those that some effects show in alone."""
        return set()

    def feels(self, cause: Cause, setup: Setup, table: ReadingTable) -> bool:
        """Whether an effect can change anything that its rows depend on."""
        return True

    def extended(self, setup: Setup, unknowns: Array, uses: Iterable[Use]) -> Setup:
        """The setup with the factors on stiffness and permittivity, then with effects."""
        factors = np.exp(unknowns[FACTORS]).tolist()
        return extended(setup.with_films(lambda film: with_factors(film, *factors)), uses)

    def written(self, table: ReadingTable, names: Sequence[str], models: Mapping[str, Array]
                ) -> Mapping[str, Array] | None:
        """Columns of a file of its own, with what models say of each row; None without one."""
        return None

    def specimens(self, setup: Setup) -> tuple[Specimen, ...]:
        """The specimens that are worth a file."""
        return setup.specimens

    def wrote(self, files: NDArray[np.str_]) -> Mask:
        """Mask of the names of files, whatever their formats, that are of this kind's."""
        stems = [name.partition(".")[0] for name in files.tolist()]
        return np.isin(np.array(stems, str), [Path(name).stem for name in self.files])


@runtime_checkable
class StripEvidence(Evidence, Protocol):
    """Readings of films that no plate loads: they predict themselves what they show."""

    def predict(self, model: Predicts, hypothesis: Hypothesis, unknowns: Array,
                table: ReadingTable) -> Shown:
        """Predicted readings of a table's rows, all of this kind."""


class FilmsUnderLoads(Protocol):
    """Films under loads as kinds of evidence ask them, of every state, shape (states,).

    ``behind``: share of the last jump by which it is read late; ``moving``: what swings with the
    plate [kg]. At heaves [m]: ``capacitance`` [F]; ``tilt``, whichever way [rad]; ``force`` that
    holds the plate [N]; ``stiffness`` of film and rig [N/m], and ``swing``, that of a swinging
    plate over it, complex; ``scanned``: displacements at the places of a scan, by its number, in
    one state [m], shape (3, places).
    """

    @property
    def table(self) -> ReadingTable: ...
    @property
    def rig(self) -> Rig: ...
    @property
    def behind(self) -> Array: ...
    @property
    def moving(self) -> Array: ...
    def capacitance(self, heave: Array) -> Array: ...
    def tilt(self, heave: Array) -> Array: ...
    def force(self, heave: Array) -> Array: ...
    def stiffness(self, heave: Array) -> Array: ...
    def swing(self, stiffness: Array) -> Array: ...
    def scanned(self, number: int, state: int, heave: Array) -> Array: ...


class PlateEvidence(Evidence, Protocol):
    """Readings of plates under loads.

    ``alone``: without others they tell a mass from a stiffness. ``noisy``: their rows come with
    their noise, and are neither averaged nor rounded. ``columns`` of files that
    :mod:`~tympan.studies.data.dataset` does not know, by name, and ``units`` of kinds of rows that
    :mod:`~tympan.studies.diagnosis.reading_table` does not know.
    """

    columns: ClassVar[Mapping[str, tuple[Column, ...]]] = {}
    units: ClassVar[Mapping[str, Unit]] = {}
    loaded: ClassVar[bool] = True
    alone: ClassVar[bool] = False
    noisy: ClassVar[bool] = False

    def read(self, dataset: Dataset, setup: Setup) -> tuple[list[ReadingTable], list[str]]:
        """The rows of its files, of a setup's specimens, and what was done to the readings.

        A standard deviation that nobody states is nan.
        """
        return [], []

    def shown(self, films: FilmsUnderLoads, kind: str, rows: Numbers, heave: Array) -> Array:
        """Predicted readings of rows of one of its kinds, at these deflections of states [m]."""

    def patterns(self, table: ReadingTable, names: Sequence[str], predicted: Array
                 ) -> dict[str, Array]:
        return patterns(table, names, predicted)


def numbers_of(setup: Setup, names: NDArray[np.str_]) -> list[int]:
    """The numbers of specimens with these names."""
    numbers = {specimen.name: number for number, specimen in enumerate(setup.specimens)}
    return [numbers[name] for name in names.tolist()]


def rows_of(evidence: Sequence[Evidence], table: ReadingTable) -> Mask:
    """Mask of the rows of a table that are of some kinds of evidence."""
    return np.isin(table.kind, [name for kind in evidence for name in kind.kinds])


@dataclass(frozen=True, eq=False)
class PreparedReadings:
    """The setup with the specimens that were read, the table, and its kinds of evidence.

    ``remarks`` say what was done to the readings. ``coupons``: those that are weighed with them, of
    the same film.
    """

    setup: Setup
    table: ReadingTable
    evidence: tuple[Evidence, ...]
    remarks: tuple[str, ...] = ()
    coupons: PreparedReadings | None = None

    @property
    def assumed(self) -> bool:
        """Whether nothing says how large the noise is."""
        return self.table.noise.source == "assumed"

    @property
    def observables(self) -> set[Observable]:
        """Observables that are read, of those that some effects show in alone."""
        return set().union(*(kind.observables(self.table) for kind in self.evidence))

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Effects that these readings could show."""
        others, read = () if self.coupons is None else self.coupons.causes, self.observables
        return tuple(cause for name, effect in EFFECTS.items()
                     for cause in (Cause(name, which) for which in effect.choices(self.setup))
                     if cause in others or (read.issuperset(effect.shows_in) and all(
                         kind.feels(cause, self.setup, self.table) for kind in self.evidence)
                         and _has_place(cause, self.setup)))


def _has_place(cause: Cause, setup: Setup) -> bool:
    """Whether an effect has what it acts on: some act on a plate."""
    if any(specimen.plate is not None for specimen in setup.specimens):
        return True
    sizes = [parameter.deviation for parameter in cause.effect.parameters]
    try:
        edited = cause.effect.at(setup, sizes, cause.which)
    except InputError as error:
        return error.key != "plate"
    try:
        edited.rig.require_none_of_plate()
    except InputError:
        return False
    return True
