"""Measured data: a folder with dataset.toml and CSV files, read with exact messages."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.base.errors import InputError, did_you_mean
from tympan.base.fields import Key, read
from tympan.base.read_file import file_bytes, near_name
from tympan.base.toml_reader import FINITE, NON_NEGATIVE, POSITIVE, Rule, Table
from tympan.base.units import LEAST_STEP
from tympan.fem.rig import OWN, Loads, Rig, load_actuator, mounted_together, rig_under
from tympan.geometry.specimen import Specimen
from tympan.studies.columns import Column, Sheet, read_sheet
from tympan.studies.data import coupon
from tympan.studies.data.checked_runs import CheckedRun, checked_runs
from tympan.studies.data.coupon import Coupons
from tympan.studies.data.effort import Effort
from tympan.studies.data.findings import CopiedRows, RunZeros, at_sensor_end
from tympan.studies.data.segment_columns import (
    require_proportion,
    segment_columns,
    with_voltages,
)
from tympan.studies.shipped import FILES as SHIPPED
from tympan.studies.shipped import specimen_tables
from tympan.tables.formats import FORMATS, Format, format_of, suffixes
from tympan.tables.layouts import Layout
from tympan.tables.meanings import (
    CAPACITANCES,
    DISPLACEMENTS,
    FILM_VOLTAGES,
    FORCES,
    FREQUENCIES,
    HIGHER_VOLTAGES,
    LOADS,
    LOWER_VOLTAGES,
    MASSES,
    QUALITIES,
    RANGES,
    RUNS,
    SET_VOLTAGES,
    SPECIMENS,
    TIMES,
    TOTALS,
    VOLTAGES,
)

_VOLTAGE: Rule = (lambda x: 0 <= x <= 1e6, "must be from 0 to 1000 kV; the film's pull has no "
                                            "sign: write voltages without one")
_MASS: Rule = (lambda x: 0 <= x <= 100, "must be from 0 to 100 kg")
_DISPLACEMENT: Rule = (lambda x: abs(x) <= 10, "must be within 10 m")
_FREQUENCY: Rule = (lambda x: 0 < x <= 1e6, "must be above 0 Hz, to 1 MHz")
_QUALITY: Rule = (lambda x: x > 0.5, "must be above 0.5: a plate more damped does not swing")
_TIME: Rule = (lambda x: abs(x) <= 1e9, "must be within 1e9 s")
_STRIPS: Rule = (lambda x: 0 <= x < 1, "must be a share from 0 (all alike) to below 1")
#: Column that every file but coupon.csv has.
SPECIMEN = Column.labels("specimen", also=SPECIMENS)
#: Columns of a film under a load.
LOAD_COLUMNS: tuple[Column, ...] = (
    SPECIMEN, Column("mass", "g", _MASS, also=(TOTALS, MASSES, LOADS)))
#: Column of the nominal voltage.
VOLTAGE_COLUMN = Column("voltage", "kV", _VOLTAGE, also=(SET_VOLTAGES, VOLTAGES))
_DEFLECTION = Column("displacement", "mm", _DISPLACEMENT, also=(DISPLACEMENTS,))
_RUN = Column.labels("run", required=False, also=RUNS)
_SIGMA = Column("sigma", "mm", POSITIVE, required=False)
_DWELL = Column("dwell", "s", NON_NEGATIVE, required=False)

#: Columns of static.csv. ``run``: mounting or ramp of a reading; ``direction``: way in which the
#: voltage got there; ``sigma``: standard deviation of the displacement; ``dwell``: time for which
#: the state was held before the reading; ``film_voltage``: that of a probe on the film; ``tilt``:
#: the plate's, ``tilt_x`` and ``tilt_y`` its slopes along x and y, positive where its side at +x or
#: +y is deflected further, ``sigma_tilt`` their standard deviation. A dataset with segments also
#: has the columns of :func:`tympan.studies.data.segment_columns.segment_columns`.
STATIC: tuple[Column, ...] = (
    *LOAD_COLUMNS,
    VOLTAGE_COLUMN,
    _DEFLECTION,
    _RUN,
    Column.labels("repeat", required=False),
    Column("order", required=False),
    Column("elapsed", "s", _TIME, required=False, also=(TIMES,)),
    Column.labels("direction", ("up", "down"), required=False),
    _SIGMA,
    _DWELL,
    Column("capacitance", "pF", POSITIVE, required=False, also=(CAPACITANCES,)),
    Column("film_voltage", "kV", _VOLTAGE, required=False, also=(FILM_VOLTAGES,)),
    Column("tilt", "mrad", FINITE, required=False),
    Column("tilt_x", "mrad", FINITE, required=False),
    Column("tilt_y", "mrad", FINITE, required=False),
    Column("sigma_tilt", "mrad", POSITIVE, required=False),
)
#: Columns of range.csv: largest minus smallest displacement between two voltages; ``sigma``: that
#: of the range, √2 of a reading's where it is left out; ``dwell``: time for which each of the
#: voltages was held.
RANGE: tuple[Column, ...] = (
    *LOAD_COLUMNS,
    Column("voltage_min", "kV", _VOLTAGE, also=(LOWER_VOLTAGES,)),
    Column("voltage_max", "kV", _VOLTAGE, also=(HIGHER_VOLTAGES,)),
    Column("range", "mm", _DISPLACEMENT, also=RANGES),
    _SIGMA,
    _DWELL,
)
#: Columns of transient.csv; ``rest``: how long the mass hung under the first voltage before, for
#: ever where it is left out; ``film_voltage`` across the film and ``current`` into its electrodes
#: are kept but not judged.
TRANSIENT: tuple[Column, ...] = (
    *LOAD_COLUMNS,
    replace(_RUN, required=True),
    Column("t", "s", _TIME, also=(TIMES,)),
    VOLTAGE_COLUMN,
    _DEFLECTION,
    Column("rest", "s", NON_NEGATIVE, required=False),
    Column("film_voltage", "kV", _VOLTAGE, required=False, also=(FILM_VOLTAGES,)),
    Column("current", "uA", required=False),
)

#: Columns of frequency.csv: natural frequencies of small oscillations about equilibrium under mass
#: and voltage. ``mode``: only the lowest one of the plate up and down can be predicted;
#: ``quality``: quality factor, f over the width at half the power; ``sigma``: standard deviation of
#: the frequency.
FREQUENCY: tuple[Column, ...] = (
    *LOAD_COLUMNS,
    VOLTAGE_COLUMN,
    Column.labels("mode", ("heave",)),
    Column("frequency", "Hz", _FREQUENCY, also=(FREQUENCIES,)),
    Column("quality", rule=_QUALITY, required=False, also=(QUALITIES,)),
    Column("sigma", "Hz", POSITIVE, required=False),
)

#: Columns of field.csv: the film at places, from laser line or digital image correlation. ``x``,
#: ``y``: along the frame's axes from its centre, or from the plate's (``field_frame``). Where
#: displacements ``u`` or ``v`` along x and y were read, these are places of the undeformed film;
#: else they are fixed places. ``repeat``: number of the line or picture in one state.
FIELD: tuple[Column, ...] = (
    *LOAD_COLUMNS,
    VOLTAGE_COLUMN,
    Column("x", "mm", _DISPLACEMENT),
    Column("y", "mm", _DISPLACEMENT),
    _DEFLECTION,
    Column("u", "mm", _DISPLACEMENT, required=False),
    Column("v", "mm", _DISPLACEMENT, required=False),
    Column.labels("repeat", required=False),
    _SIGMA,
)

#: Columns of force.csv: the plate held by a tester, with the force on the film, positive along the
#: deflection; ``sigma``: standard deviation of the force. ``direction``, ``t`` and ``tilt`` are
#: kept but not judged.
FORCE: tuple[Column, ...] = (
    SPECIMEN,
    VOLTAGE_COLUMN,
    _DEFLECTION,
    Column("force", "mN", also=(FORCES,)),
    _RUN,
    Column.labels("direction", ("out", "back"), required=False),
    Column("t", "s", _TIME, required=False, also=(TIMES,)),
    Column("tilt", "mrad", FINITE, required=False),
    Column("sigma", "mN", POSITIVE, required=False),
)

#: Mark of a line in a draft that is to be corrected.
GUESS = "CORRECT THIS:"

#: Files of readings that a dataset may contain, and their columns: those of all kinds of evidence.
FILES: dict[str, tuple[Column, ...]] = {
    "static.csv": STATIC, "range.csv": RANGE, "transient.csv": TRANSIENT,
    "coupon.csv": coupon.COLUMNS, "frequency.csv": FREQUENCY, "field.csv": FIELD,
    "force.csv": FORCE}
#: Files whose sheets have names of their own below; further ones are read by their kinds alone.
_WITH_FIELD = ("static.csv", "range.csv", "transient.csv", "coupon.csv", "frequency.csv",
               "field.csv", "force.csv")

#: How far outside the frame places may lie, as shares of the frame's larger half extent: when read
#: at the film's edge, and when counted from a plate that may be off centre.
_OUTSIDE = {"table": 5e-3, "plate": 0.1}

#: Columns of static.csv with quantities measured besides the displacement.
CHANNELS = ("capacitance", "film_voltage", "tilt", "tilt_x", "tilt_y")

#: Files whose readings may be made with different voltages on segments.
_SEGMENTED = ("static.csv", "frequency.csv", "force.csv", "transient.csv")
#: Those of them whose segments keep the proportion of the specimen's file.
_IN_PROPORTION = ("transient.csv",)


@dataclass(frozen=True, eq=False)
class Dataset:
    """Measured readings with the specimens and the rig they came from.

    ``static``, ``ranges``, ``transients``, ``frequencies``, ``fields`` and ``forces`` have the
    columns of :data:`STATIC`, :data:`RANGE`, :data:`TRANSIENT`, :data:`FREQUENCY`, :data:`FIELD`
    and :data:`FORCE`.
    ``files``: those that were read, with the SHA-256 of their bytes; ``remarks``: oddities found.
    ``formula``: film in closed form by which they are judged, in place of finite elements.
    """

    name: Annotated[str, Key("what messages call it")]
    specimens: Annotated[tuple[Specimen, ...], Key(
        "what was measured: a table each, written as a specimen's file, or with `file`, the name "
        "of one", name="specimen", also=("specimens",))]
    rig: Annotated[Rig, Key("what acts on plate and film besides the nominal load: its keys, or "
                            "the name of their file", default="that of the specimens")]
    source: Annotated[str, Key("where the data are from")] = "not stated"
    noise: Annotated[float | None, Key(
        "standard deviation of one reading of the displacement", "length", POSITIVE)] = None
    voltage_noise: Annotated[float, Key(
        "standard deviation of the voltage of each state that was read, besides the noise of a "
        "reading", "voltage", NON_NEGATIVE)] = 0.0
    film_scatter: Annotated[float, Key(
        "by what share stiffness and permittivity of the specimens' films differ from each other: "
        "5 % is usual of films of one roll that were stretched by hand", rule=_STRIPS)] = 0.0
    effort: Annotated[Effort, Key("what readings cost whoever makes them")] = Effort()
    field_frame: Annotated[Literal["table", "plate"], Key(
        "from where places in field.csv are counted: the frame's centre, or the plate's")] = "table"
    coupon_reading: Annotated[Literal["stress", "drop"], Key(
        "what is judged of coupon.csv: the stress, or by how much it drops under voltage against "
        "the run without voltage of the same film in the same mode at the same temperature"
        )] = "stress"
    strip_scatter: Annotated[float, Key(
        "by what share of the stress strips of one film differ, smoothly along a run, besides the "
        "noise of a reading", rule=_STRIPS)] = 0.0
    layouts: Annotated[Mapping[str, Layout], Key(
        "how a file of readings is laid out that has not the usual headings: a table for each, "
        "[columns.static] for static.csv", name="columns")] = field(default_factory=dict)
    static: Sheet | None = None
    ranges: Sheet | None = None
    transients: Sheet | None = None
    coupons: Coupons | None = None
    frequencies: Sheet | None = None
    fields: Sheet | None = None
    forces: Sheet | None = None
    more: Mapping[str, Sheet] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    formula: str | None = None

    @property
    def tables(self) -> dict[str, Sheet | Coupons]:
        """Tables of the dataset, by file name."""
        tables = (self.static, self.ranges, self.transients, self.coupons, self.frequencies,
                  self.fields, self.forces)
        every = {**dict(zip(_WITH_FIELD, tables, strict=True)), **self.more}
        return {name: table for name, table in every.items() if table is not None}

    @property
    def sheets(self) -> tuple[Sheet, ...]:
        """The tables of readings of actuators that the dataset has."""
        return tuple(table for table in self.tables.values() if isinstance(table, Sheet))

    @cached_property
    def runs(self) -> tuple[CheckedRun, ...]:
        """The runs in time as they are judged."""
        return () if self.transients is None else checked_runs(self.transients)

    @cached_property
    def copies(self) -> CopiedRows:
        """Static readings that are copies of others."""
        none = np.empty(0, np.int64)
        if self.static is None:
            return CopiedRows(none, none)
        return CopiedRows.among(self.static, self.noise)

    @property
    def unused(self) -> Mask:
        """Mask of static readings without information: copies, and those of a sensor at its end."""
        if self.static is None:
            return np.empty(0, bool)
        unused = at_sensor_end(self.static)
        unused[self.copies.rows] = True
        return unused

    @cached_property
    def run_zeros(self) -> RunZeros | None:
        """Zeros that have moved between the runs of static readings."""
        return None if self.static is None else RunZeros.of(self.static, self.unused)

    @property
    def masses(self) -> Array:
        """Masses under which anything was read [kg], row by row."""
        masses = (sheet.mass for sheet in self.sheets if "mass" in sheet.values)
        return np.concatenate([np.empty(0), *masses])


def read_dataset(folder: Path | str, planned: bool = False) -> Dataset:
    """Read a dataset by its folder, or by the dataset.toml in it.

    The specimen of a coupon names its strip and need not be one of dataset.toml. For readings that
    are only ``planned``, static.csv and range.csv may leave out the measured values. Raise an
    :class:`InputError` that names file and key, or line and column, of what cannot be used.
    """
    folder = _dataset_folder(Path(folder))
    about = folder / "dataset.toml"
    dataset = read(Dataset, Table.read(about, "dataset"), {(Dataset, "specimens"): _specimens,
                                                (Dataset, "rig"): _rig,
                                                (Dataset, "layouts"): _layouts})
    try:
        specimens, rig = mounted_together(dataset.specimens, dataset.rig)
    except InputError as error:
        raise error.located(file=about) from None
    dataset = replace(dataset, specimens=specimens, rig=rig)
    files = {name: hashlib.sha256(file_bytes(folder / name)).hexdigest()
             for name in (about.name, *_specimen_files(about))}
    there = sorted(file.name for file in folder.iterdir() if file.suffix.lower() in suffixes())
    published, others = _other_files(folder, there, dataset)
    remarks = [*_guesses(about), *others]
    sheets: dict[str, Sheet] = {}
    for name in FILES:
        file = _sheet_file(folder, name, dataset)
        if file is None:
            continue
        sheets[name], more = _checked_sheet(file, name, dataset, planned)
        files[file.name] = sheets[name].sha256
        remarks += more
    static, ranges, transients, coupons, frequencies, fields, forces = map(
        sheets.get, _WITH_FIELD)
    if ranges is not None:
        _check_ranges(ranges, dataset.rig)
    if transients is not None:
        _check_times(transients)
    if fields is not None:
        _check_places(fields, dataset)
    tests = [Coupons.of(coupons)] if coupons is not None else []
    for file in published:
        sheet = read_sheet(file, coupon.COLUMNS)
        files[file.name] = sheet.sha256
        tests.append(Coupons.of(sheet))
    if not sheets and not tests:
        words = f"; there: {', '.join(there)}" if there else ""
        raise InputError(f"must hold at least one of {', '.join(FILES)}{words}", file=folder)
    return replace(dataset, static=static, ranges=ranges, transients=transients, files=files,
                   coupons=Coupons.joined(tests) if tests else None,
                   frequencies=frequencies, fields=fields, forces=forces,
                   more={name: sheets[name] for name in sheets if name not in _WITH_FIELD},
                   remarks=tuple(remarks))


def _dataset_folder(path: Path) -> Path:
    """Find the folder of a dataset by its own path, or by that of its dataset.toml."""
    folder = path.parent if path.name == "dataset.toml" and path.is_file() else path
    if not folder.is_dir():
        hint = "" if folder.exists() else near_name(folder)
        raise InputError("must be a folder with dataset.toml and at least one CSV file of readings"
                         + hint, file=folder)
    return folder


def _other_files(folder: Path, there: Sequence[str], dataset: Dataset
                 ) -> tuple[dict[Path, Format], list[str]]:
    """Find published files of coupons, each with its format; remark on every file not in FILES."""
    stems = {Path(name).stem: name for name in FILES}
    named = {layout.file for layout in dataset.layouts.values()}
    others = [folder / name for name in there
              if Path(name).stem not in stems and name not in named]
    published = {file: kind for file in others if (kind := _published(file)) is not None}
    known = f"known are {', '.join(FILES)}, and {_publications()}"
    remarks = [f"{file.name} is not read: {did_you_mean(file.stem.lower(), stems)}{known}"
               for file in others if file not in published]
    for kind in dict.fromkeys(published.values()):
        same = [file.name for file, other in published.items() if other is kind]
        remarks.append(f"read as {kind.explanation}: {', '.join(same)}")
    return published, remarks


def _sheet_file(folder: Path, name: str, dataset: Dataset) -> Path | None:
    """Find one of FILES, in any format, by the name in its layout or by its own; None: absent."""
    stem = Path(name).stem
    layout = dataset.layouts.get(stem)
    if layout is not None and layout.file:
        return folder / layout.file
    files = [file for suffix in suffixes() if (file := folder / f"{stem}{suffix}").exists()]
    if len(files) > 1:
        names = " and ".join(file.name for file in files)
        raise InputError(f"must stand there once, in one format: there are {names}", file=folder,
                         key=stem)
    if not files and layout is not None:
        raise InputError(f"there is no {name}: write its name, file = \"…\"",
                         file=folder / "dataset.toml", key=f"columns.{stem}")
    return files[0] if files else None


def _checked_sheet(file: Path, name: str, dataset: Dataset, planned: bool
                   ) -> tuple[Sheet, list[str]]:
    """Read one of FILES, check its specimens, masses and copies, and list remarks on it."""
    later: tuple[str, ...] = ("displacement", "range", "frequency") if planned else ()
    names = [specimen.name for specimen in dataset.specimens]
    # A film without plate carries no mass.
    alone = [specimen.name for specimen in dataset.specimens if specimen.plate is None]
    later += ("mass",) if alone else ()
    several = segment_columns(dataset.specimens, _VOLTAGE, name == "static.csv") * (
        name in _SEGMENTED)
    if several:
        later += ("voltage",)
    columns = [replace(column, required=column.required and column.name not in later,
                       example=names[0] if column is SPECIMEN else column.example)
               for column in (*FILES[name], *several)]
    stem = Path(name).stem
    sheet = read_sheet(file, columns, layout=dataset.layouts.get(stem, Layout()), table=stem,
                       usual=_usual(dataset, file))
    if SPECIMEN not in FILES[name]:
        return sheet, list(sheet.remarks)
    _check_specimens(sheet, names)
    if name in _SEGMENTED:
        sheet = with_voltages(sheet, dataset.specimens)
    if name in _IN_PROPORTION:
        require_proportion(sheet, dataset.specimens)
    if alone and "mass" in sheet.values:
        sheet = _unloaded(sheet, alone)
    return sheet, [*sheet.remarks, *_identical(sheet)]


def _check_ranges(ranges: Sheet, loads: Loads) -> None:
    """Refuse ranges between voltages that do not ascend, and negative ones of mere loads."""
    for row in np.flatnonzero(ranges.voltage_max <= ranges.voltage_min):
        raise ranges.error(int(row), "voltage_max", "must be above voltage_min")
    if loads.gas_pressure > 0 or loads.biases:
        # Gas from below or a mechanism may lift a film, the more so the higher the voltage.
        return
    for row in np.flatnonzero(ranges.range < 0):
        raise ranges.error(int(row), "range", "must not be negative: a load pulls the film "
                                              "further down as the voltage rises")


def _unloaded(sheet: Sheet, alone: Sequence[str]) -> Sheet:
    """Set the mass to zero on films that have no plate."""
    bare = np.isin(sheet.specimen, alone)
    for row in np.flatnonzero(bare & (np.nan_to_num(sheet.mass) != 0)):
        raise sheet.error(int(row), "mass", "must be 0 or left out: a mass hangs on a plate, and "
                                            "the film has none")
    for row in np.flatnonzero(~bare & np.isnan(sheet.mass)):
        raise sheet.error(int(row), "mass", "must be a number: the film has a plate")
    return replace(sheet, values={**sheet.values, "mass": np.nan_to_num(sheet.mass)})


def _guesses(about: Path) -> list[str]:
    """List lines of a draft that were to be corrected, and still say so."""
    lines = about.read_text(encoding="utf-8").splitlines()
    found = []
    for number, line in enumerate(lines, 1):
        stated, guess, why = line.partition(GUESS)
        if guess:
            what = f"{stated.strip(' #')!r} is a guess of the draft: " if stated.strip(" #") else ""
            found.append(f"{about.name}, line {number}: {what}{why.strip(' .')}. Correct the line, "
                         f"then delete the words {GUESS}")
    return found


def _layouts(table: Table, key: str) -> dict[str, Layout]:
    """Read the layouts of files by their names without suffix."""
    part, kinds = table.table(key, {}), [Path(name).stem for name in FILES]
    layouts = {kind: _layout(part.table(kind)) for kind in kinds if kind in part}
    part.asked.update(kinds)
    part.done()
    return layouts


def _layout(table: Table) -> Layout:
    """Read a layout; its file is relative to the dataset."""
    if "file" in table:
        table.beside("file")
    return Layout.from_table(table)


def _usual(dataset: Dataset, file: Path) -> dict[str, str]:
    """List statements that hold for a file unless it says otherwise."""
    usual = {"run": "1"}
    if len(dataset.specimens) == 1:
        usual["specimen"] = dataset.specimens[0].name
    return usual | coupon.named_mode(file)


def _published(file: Path) -> Format | None:
    """Recognise a coupon format that is independent of the file's name; None for other files."""
    kind = format_of(file, file_bytes(file))
    return kind if kind is not None and kind.table else None


def _publications() -> str:
    """Describe formats of files that may have any name, in words."""
    return "; ".join(kind.explanation for kind in FORMATS.values() if kind.table)


def channels(static: Sheet) -> tuple[str, ...]:
    """List quantities that were measured besides the displacement."""
    return tuple(name for name in CHANNELS if np.isfinite(static[name]).any())


def _specimen_files(about: Path) -> list[str]:
    """List the files of specimens and rig that a dataset names."""
    table = Table.read(about)
    rig = [table.text("rig")] if isinstance(table.value("rig", None), str) else []
    names = (part if isinstance(part, str) else part.data.get("file")
             for part in table.parts("specimen", "specimens"))
    return rig + [name for name in names if name is not None and name not in SHIPPED]


def _specimens(table: Table, key: str) -> tuple[Specimen, ...]:
    if not table.value(key, []):
        raise table.error(key, "is missing: write one [[specimen]] table for each specimen")
    entries = specimen_tables(table, key)
    specimens = tuple(map(load_actuator, entries))
    names = [specimen.name for specimen in specimens]
    for entry, name in zip(entries, names, strict=True):
        if names.count(name) > 1:
            raise entry.error("name", "is there twice: specimens must have different names", name)
    return specimens


def _rig(table: Table, key: str) -> Rig:
    table.asked.update((key, "gravity"))
    rig = rig_under(table, key)
    if "gravity" not in table:
        return OWN if rig is None else rig
    if rig is not None:
        raise table.error("gravity", "must stand in [rig] where there is such a table",
                          table.value("gravity"))
    return Rig(gravity=table.number("gravity", "acceleration", rule=POSITIVE))


def _check_specimens(sheet: Sheet, names: list[str]) -> None:
    for row in np.flatnonzero(~np.isin(sheet.specimen, names)):
        hint = did_you_mean(str(sheet.specimen[row]), {name: repr(name) for name in names})
        raise sheet.error(int(row), "specimen", f"unknown specimen: {hint}those of dataset.toml "
                                                f"are {', '.join(names)}; call it as there, or "
                                                "write one more [[specimen]]")


def _check_times(transients: Sheet) -> None:
    """Refuse times of a run that are equal within rounding."""
    runs = [np.unique(transients[name], return_inverse=True)[1].ravel()
            for name in ("specimen", "mass", "run")]
    order = np.lexsort((transients.t, *runs))
    close = np.diff(transients.t[order]) < LEAST_STEP
    close &= np.all([np.diff(run[order]) == 0 for run in runs], axis=0)
    for earlier, later in zip(order[:-1][close], order[1:][close], strict=True):
        row, other = max(earlier, later), min(earlier, later)
        raise transients.error(int(row), "t", "must be there once in a run: it stands in line "
                               f"{transients.line[other]} too, within 1 ns")


def _check_places(fields: Sheet, dataset: Dataset) -> None:
    """Refuse places that lie outside the frame."""
    for specimen in dataset.specimens:
        rows = np.flatnonzero(fields.specimen == specimen.name)
        size, offset = max(specimen.frame.semi_axes), specimen.centre
        x, y = ((fields.x, fields.y) if dataset.field_frame == "table"
                else (fields.x + offset[0], fields.y + offset[1]))
        beyond = specimen.frame.level(x[rows], y[rows]) > _OUTSIDE[dataset.field_frame] * size
        for row in rows[beyond]:
            name = "x" if abs(fields.x[row]) >= abs(fields.y[row]) else "y"
            reach = " by ".join(f"{2e3 * half:.4g}" for half in specimen.frame.semi_axes)
            raise fields.error(int(row), name, "must lie on the film or the plate, in mm from the "
                               f"{'frame' if dataset.field_frame == 'table' else 'plate'}'s centre "
                               f"(field_frame = {dataset.field_frame!r}); the frame of "
                               f"{specimen.name} is {reach} mm wide")


def _identical(sheet: Sheet) -> list[str]:
    """Refuse equal rows where rows have a distinguishing column; remark on them elsewhere."""
    first: dict[tuple[str, ...], int] = {}
    earlier_rows = [first.setdefault(tuple(cells), row) for row, cells in enumerate(sheet.cells)]
    pairs = [(row, earlier) for row, earlier in enumerate(earlier_rows) if row != earlier]
    for mark in ("repeat", "order", "elapsed", "t"):
        for row, earlier in pairs:
            if mark in sheet.places and sheet.cells[row][sheet.places[mark]]:
                raise sheet.error(row, mark, f"the row is the same as line {sheet.line[earlier]} "
                                             "in every cell: a reading must stand once")
    if not pairs:
        return []
    row, earlier = pairs[0]
    return [f"{sheet.file.name}: {len(pairs)} rows are the same as an earlier one in every cell, "
            f"first line {sheet.line[row]} as line {sheet.line[earlier]}: they count as repeats, "
            "unless they are named as copies; if pasted twice, the noise is understated"]
