"""Measured data: a folder with dataset.toml and CSV files, read with exact messages."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.geometry.toml_reader import POSITIVE, Table
from tympan.studies.columns import Column, Sheet, read_sheet
from tympan.studies.data import coupon, readings
from tympan.studies.data.coupon import Coupons
from tympan.studies.data.readings import Ranges, StaticReadings, Transients

T = TypeVar("T")

@dataclass(frozen=True)
class SourceFile:
    """A file that was read, and the SHA-256 of its bytes."""

    name: str
    sha256: str


@dataclass(frozen=True, eq=False)
class Dataset:
    """Measured readings with the specimens and the rig they came from.

    ``noise`` is the standard deviation of one reading of the displacement as the user gives it [m];
    None where not. ``source`` says in words where the data are from; ``files`` are those read,
    ``remarks`` what reading found odd. Each reading's ``line`` is its line in its file.
    """

    name: str
    source: str
    specimens: tuple[Specimen, ...]
    rig: Rig
    noise: float | None = None
    static: StaticReadings | None = None
    ranges: Ranges | None = None
    transients: Transients | None = None
    coupons: Coupons | None = None
    files: tuple[SourceFile, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def tables(self) -> dict[str, StaticReadings | Ranges | Transients | Coupons]:
        """What there is, by file name."""
        every = zip(FILES, (self.static, self.ranges, self.transients, self.coupons), strict=True)
        return {name: table for name, table in every if table is not None}


#: The files of readings a dataset may hold.
FILES = ("static.csv", "range.csv", "transient.csv", "coupon.csv")


def read_dataset(folder: Path | str, planned: bool = False) -> Dataset:
    """Read a dataset's folder.

    The specimen of a coupon names its strip and need not be one of dataset.toml.

    Of readings that are only ``planned`` static.csv and range.csv may leave out what was read.

    Raises
    ------
    InputError
        Naming file and key, or line and column, of what cannot be used, what was given and what is
        allowed.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError("must be a folder with dataset.toml and at least one CSV file of readings",
                         file=folder)
    about, specimens, rig, noise = _about(Table.read(folder / "dataset.toml"))
    files = _Files(folder, [specimen.name for specimen in specimens], planned)
    dataset = Dataset(
        *about, specimens, rig, noise,
        static=files.read("static.csv", readings.STATIC, readings.static_from_sheet),
        ranges=files.read("range.csv", readings.RANGE, readings.ranges_from_sheet),
        transients=files.read("transient.csv", readings.TRANSIENT, readings.transients_from_sheet),
        coupons=files.read("coupon.csv", coupon.COLUMNS, coupon.coupons_from_sheet),
        files=(SourceFile("dataset.toml",
                          hashlib.sha256((folder / "dataset.toml").read_bytes()).hexdigest()),
               *files.sources),
        remarks=(*_strangers(folder), *files.remarks))
    if not dataset.tables:
        there = f"; there: {', '.join(names)}" if (names := _csv_names(folder)) else ""
        raise InputError(f"must hold at least one of {', '.join(FILES)}{there}", file=folder)
    return dataset


@dataclass
class _Files:
    """The CSV files of a folder while they are read, and what is kept of each."""

    folder: Path
    known: list[str]
    planned: bool
    sources: list[SourceFile] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def read(self, name: str, columns: tuple[Column, ...], build: Callable[[Sheet], T]) -> T | None:
        """The readings of one file; None where there is none."""
        if not (self.folder / name).exists():
            return None
        later = ("displacement", "range") if self.planned else ()
        sheet = read_sheet(self.folder / name,
                           [replace(column, required=False) if column.name in later else column
                                                for column in columns])
        if readings.SPECIMEN in columns:
            _check_specimens(sheet, self.known)
            self.remarks.extend(_identical(sheet, name))
        self.sources.append(SourceFile(name, sheet.sha256))
        return build(sheet)


def _about(table: Table) -> tuple[tuple[str, str], tuple[Specimen, ...], Rig, float | None]:
    """Name and source, specimens, rig and noise of dataset.toml."""
    about = table.text("name"), table.text("source", "not stated")
    specimens, rig = _specimens(table), _rig(table)
    table.asked.add("noise")
    noise = table.quantity("noise", "length", rule=POSITIVE) if "noise" in table else None
    table.done()
    return about, specimens, rig, noise


def _specimens(table: Table) -> tuple[Specimen, ...]:
    """The specimens of dataset.toml."""
    entries = table.tables("specimen")
    if not entries:
        raise table.error("specimen", "is missing: write one [[specimen]] table for each specimen")
    specimens = tuple(load_specimen(entry) for entry in entries)
    names = [specimen.name for specimen in specimens]
    for entry, name in zip(entries, names, strict=True):
        if names.count(name) > 1:
            raise entry.error("name", "is there twice: specimens must have different names", name)
    return specimens


def _rig(table: Table) -> Rig:
    """The rig of dataset.toml: its table, or gravity alone."""
    table.asked.update(("rig", "gravity"))
    if "rig" not in table:
        return Rig(gravity=table.quantity("gravity", "acceleration", "9.80665 m/s^2", POSITIVE))
    if "gravity" in table:
        raise table.error("gravity", "must stand in [rig] where there is such a table",
                          table.value("gravity"))
    return Rig.from_table(table.table("rig"))


def _csv_names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir() if file.suffix.lower() == ".csv")


def _strangers(folder: Path) -> list[str]:
    """A remark on each CSV file nobody will read."""
    remarks = []
    for name in _csv_names(folder):
        if name not in FILES:
            near = difflib.get_close_matches(Path(name).stem.lower(),
                                             [Path(file).stem for file in FILES], 1)
            hint = f"did you mean {near[0]}.csv? " if near else ""
            remarks.append(f"{name} is not read: {hint}known are {', '.join(FILES)}")
    return remarks


def _check_specimens(sheet: Sheet, known: list[str]) -> None:
    """Refuse a row about a specimen that dataset.toml does not have."""
    names = set(known)
    for row, name in enumerate(sheet["specimen"].tolist()):
        if name not in names:
            near = difflib.get_close_matches(name, known, 1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise sheet.error(row, "specimen",
                              f"unknown specimen: {hint}those of dataset.toml are "
                              f"{', '.join(known)}")


def _identical(sheet: Sheet, name: str) -> list[str]:
    """Refuse rows that stand twice where a row has a mark of its own; remark on them elsewhere."""
    pairs = sheet.identical()
    for mark in ("repeat", "order", "elapsed", "t"):
        for row, earlier in pairs:
            if mark in sheet.places and sheet.cells[row][sheet.places[mark]]:
                raise sheet.error(row, mark,
                                  f"the row is the same as line {sheet.line[earlier]} in every "
                                  "cell: "
                                             "a reading must stand once")
    if not pairs:
        return []
    row, earlier = pairs[0]
    return [f"{name}: {len(pairs)} rows are the same as an earlier one in every cell, first line "
            f"{sheet.line[row]} as "
            f"line {sheet.line[earlier]}: they count as repeats; if pasted twice, the noise is "
            "understated"]
