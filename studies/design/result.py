"""Films for requirements, as they are stored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from tympan.base.fields import Key
from tympan.base.units import suffix_of
from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import rig_to_toml, specimen_to_toml
from tympan.geometry.specimen import Specimen
from tympan.studies.case import WallTime, Warnings
from tympan.studies.files import (
    from_json,
    read_json,
    remove,
    to_json,
    write_csv,
    write_json,
    write_text,
)
from tympan.studies.rows import cells_of
from tympan.studies.tolerance.result import Chance, FilmFailure
from tympan.studies.wanted import Bound

#: Status of a film that keeps all bounds, and of one that does not.
DesignStatus = Literal["met", "impossible"]


@dataclass(frozen=True, kw_only=True)
class DesignedNumber:
    """A number that was to be chosen."""

    value: Annotated[float, Key("chosen [SI]")]
    low: Annotated[float, Key("lowest that is allowed [SI]")]
    high: Annotated[float, Key("highest that is allowed [SI]")]
    unit: Annotated[str, Key("SI unit; 1 of plain numbers")]
    end: Annotated[Literal["range", "known"] | None, Key(
        "range where it is at the end of this range, known where it is at the edge of what reduced "
        "films know; none where it is at neither")]
    relaxing: Annotated[float | None, Key(
        "by which share of the aim the film gets better if that end of the range is moved out by "
        "1 % of itself; none where it holds nothing back")] = None


@dataclass(frozen=True, kw_only=True)
class DesignedQuantity:
    """A quantity of a film, with its bound where it has one."""

    name: Annotated[str, Key("of the quantity")]
    unit: Annotated[str, Key("SI unit; 1 of plain numbers")]
    sense: Annotated[Literal["at least", "at most"], Key("how a bound of it is meant")]
    bound: Annotated[float | None, Key("that was asked for [SI]; none where there was none")]
    value: Annotated[float | None, Key("of the film without scatter, by finite elements [SI]; none "
                                       "where it has none")]
    reduced: Annotated[float | None, Key("the same by reduced films, with which was searched")]
    given: Annotated[float | None, Key(
        "of the given specimen under the same loads, by finite elements [SI]; none where it has "
        "none, or some number of the specimen lies outside its range")] = None
    reached: Annotated[float | None, Key(
        "what the share of the films reach: at least, or at most; none where nothing scatters, it "
        "was not asked for, or more films do not bear their voltage (fails)")] = None
    kept: Annotated[Chance | None, Key(
        "films, drawn with their tolerances, that bear their voltage and keep the bound; none "
        "where it does not scatter")] = None
    missed: Annotated[bool, Key(
        "whether too few films keep the bound; where it does not scatter, the film without "
        "scatter")] = False
    binding: Annotated[bool, Key("whether the film would be better without this bound")] = False
    relaxing: Annotated[float | None, Key(
        "by which share of the aim the film gets better if the bound is relaxed by 1 %; none where "
        "it does not bind, or cannot be relaxed: films bear their voltage")] = None
    attainable: Annotated[float | None, Key(
        "weaker bound with which all bounds are kept, where one that binds cannot be [SI]; none "
        "elsewhere, or where no film was found that keeps the others")] = None
    attainable_ends: Annotated[Mapping[str, Literal["range", "known"]], Key(
        "numbers of the film that keeps it that are at an end, by their keys: the end of their "
        "range, or the edge of what reduced films know")] = field(default_factory=dict)


    @property
    def key(self) -> str:
        """Key among others: the name, with the sense of a bound if that is not the usual one."""
        if self.bound is None:
            return self.name
        return Bound(self.name, self.bound, self.sense == "at least").key


@dataclass(frozen=True, kw_only=True)
class DesignedFilm:
    """The best film of one kind."""

    specimen: Annotated[str, Key("its name")]
    status: Annotated[DesignStatus, Key("whether it keeps all bounds")]
    specimen_file: Annotated[str, Key("file of the specimen")]
    rig_file: Annotated[str, Key("file of the rig")]
    mass_kg: Annotated[float, Key("nominal load on the plate")]
    voltage_V: Annotated[float, Key("nominal voltage")]
    aim: Annotated[float, Key(
        "best quantity [SI], negative where least is best; with none to be best, the share by "
        "which all bounds are kept, below 0 where they cannot be")]
    numbers: Annotated[Mapping[str, DesignedNumber], Key("what was chosen, by its key")]
    quantities: Annotated[tuple[DesignedQuantity, ...], Key("what the film has")]
    reached: Annotated[Chance | None, Key(
        "films, drawn with their tolerances, that keep all bounds; none where nothing "
        "scatters")] = None
    fails: Annotated[tuple[FilmFailure, ...], Key(
        "films that do not bear their voltage, by what they meet first, the most frequent "
        "first")] = ()

    def quantity(self, name: str) -> DesignedQuantity:
        """Find a quantity by its name, or by its key where it has two bounds."""
        return next(each for each in self.quantities if name in (each.name, each.key))

    @property
    def binding(self) -> tuple[DesignedQuantity, ...]:
        """Quantities whose bounds bind."""
        return tuple(each for each in self.quantities if each.binding)


@dataclass(frozen=True, kw_only=True)
class FrontFilm:
    """A film between the best of two quantities, without scatter, by reduced films."""

    first: Annotated[float, Key("value of the first quantity [SI]")]
    second: Annotated[float, Key("value of the second [SI]")]
    numbers: Annotated[Mapping[str, float], Key("what was chosen [SI], by its key")]


@dataclass(frozen=True, kw_only=True)
class DesignFront:
    """Pareto front: films of which none is better than another in both of two quantities."""

    first: Annotated[str, Key("quantity that is best at the first film")]
    second: Annotated[str, Key("quantity that is best at the last film")]
    first_unit: Annotated[str, Key("SI unit of the first; 1 of plain numbers")]
    second_unit: Annotated[str, Key("SI unit of the second")]
    films: Annotated[tuple[FrontFilm, ...], Key(
        "films from one to the other; each keeps all bounds with the margins of the best film")]

    @property
    def table(self) -> tuple[list[str], list[list[float]]]:
        """Header and rows, SI."""
        units = [name + suffix_of(unit) for name, unit in
                 ((self.first, self.first_unit), (self.second, self.second_unit))]
        return ([*units, *self.films[0].numbers],
                [[film.first, film.second, *film.numbers.values()] for film in self.films])


@dataclass(frozen=True, kw_only=True)
class FailedKind:
    """A kind of film that was not searched, and the reason."""

    specimen: Annotated[str, Key("name of the specimen")]
    reason: Annotated[str, Key("why it was not searched")]


@dataclass(frozen=True, kw_only=True)
class DesignResult:
    """Films for requirements, the best first."""

    indexed: ClassVar[tuple[str, ...]] = ("film", "quantity")

    #: Files of the pictures of a design.
    pictures: ClassVar[tuple[str, ...]] = ("design.png", "design.svg")

    name: Annotated[str, Key("of the requirements")]
    status: Annotated[DesignStatus, Key("whether some film keeps all bounds")]
    best: Annotated[str, Key("quantity that is to be best; empty where none is")]
    share: Annotated[float, Key("share of the films that shall keep all bounds")]
    films: Annotated[tuple[DesignedFilm, ...], Key("best film of each kind, the best first")]
    failed: Annotated[tuple[FailedKind, ...], Key("kinds without films")] = ()
    front: Annotated[DesignFront | None, Key(
        "films between two quantities, where it was asked for and films keep all bounds")] = None
    wall_s: WallTime
    warnings: Warnings = ()
    specimens: Mapping[str, Specimen] = field(default_factory=dict, repr=False, compare=False)
    rigs: Mapping[str, Rig] = field(default_factory=dict, repr=False, compare=False)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each quantity of each film."""
        rows = []
        for film in self.films:
            for each in film.quantities:
                cells = cells_of(each)
                del cells["name"]
                kept = None if each.kept is None else each.kept.probability
                rows.append({"film": film.specimen_file, "quantity": each.key, **cells,
                             "kept": kept})
        return rows

    @property
    def key_numbers(self) -> dict[str, Any]:
        """The best film: whether it keeps all bounds, and what was chosen."""
        found: dict[str, Any] = {"status": self.status}
        for film in self.films[:1]:
            reached = film.reached and film.reached.probability
            found |= {"film": film.specimen_file, "mass_kg": film.mass_kg,
                      "voltage_V": film.voltage_V, "share_that_keeps_all": reached}
            found |= {key + suffix_of(number.unit): number.value
                      for key, number in film.numbers.items()}
        return found

    def json(self) -> dict[str, Any]:
        """Convert the result to a JSON object, without specimens and rigs."""
        record: dict[str, Any] = to_json(self)
        return record

    def save(self, folder: Path) -> None:
        """Write specimens and rigs, and last ``design.json``."""
        remove(folder, "design.json", "design-front.csv")
        for name, specimen in self.specimens.items():
            write_text(folder / name, specimen_to_toml(specimen))
        for name, rig in self.rigs.items():
            write_text(folder / name, rig_to_toml(rig))
        if self.front is not None:
            write_csv(folder / "design-front.csv", *self.front.table)
        write_json(folder / "design.json", self.json())

    @classmethod
    def load(cls, folder: Path) -> DesignResult:
        """Load a saved design; a missing or damaged file is an InputError."""
        file = folder / "design.json"
        found = from_json(cls, read_json(file), file)
        return replace(
            found, specimens={film.specimen_file: load_specimen(folder / film.specimen_file)
                              for film in found.films},
            rigs={film.rig_file: Rig.read(folder / film.rig_file) for film in found.films})
