"""Summary of a dataset, and warnings before anything is concluded from it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.base.constants import EPSILON_0
from tympan.geometry.outlines import area
from tympan.geometry.specimen import Specimen
from tympan.studies.columns import Sheet
from tympan.studies.data.checked_runs import Hum
from tympan.studies.data.coupon import Coupons
from tympan.studies.data.dataset import Dataset, channels
from tympan.studies.data.findings import CopiedRows, Finding, at_sensor_end
from tympan.studies.data.noise import coarse_step, repeat_groups, repeat_noise, stated_ratio
from tympan.studies.data.outliers import outliers
from tympan.studies.files import to_json, words_beside

#: Warnings by key.
WORDS = words_beside(__file__)

#: Fields in the mounted film [V/m] between which the largest voltage is not in a wrong unit. Below,
#: the Maxwell stress is under 1 Pa; VHB, the strongest film of the library, breaks down far below
#: the upper one (tympan.fem.film.breakdown).
_FIELDS = (1e5, 1e9)

#: Ratio of a capacitance to that of the mounted, flat film with electrodes over its whole frame,
#: beyond which it is in a wrong unit.
_CAPACITIES = 50.0

#: Stretch below which a strip would be compressed, with room for small errors of the zero.
_SHORT = 0.95
#: Temperature above which a film is never tested [°C]. Room temperature in kelvins is about 290.
_HOT = 200.0

#: Number of readings that show a wrong unit.
_SEVERAL = 3

#: Factor from the frequency of a mass on a spring of that deflection beyond which a frequency is
#: wrong: the stiffening of films and missing mass change it by less.
_APART = 4.0

#: Relative shift of a line's frequency by aliasing from which the shift is mentioned: clock errors
#: are smaller.
_FOLDED = 0.02

#: Correlation of readings with the voltage's square below which they fall, so that scatter alone
#: does not count.
_FALLS = -0.9
#: Fewest different voltages for a fall: a few readings fall by chance.
_FEWEST = 4
#: Share of a deflection by which it must fall as the voltage rises to have the wrong sign: sensor
#: drift is smaller.
_LIFTED = 0.05


def summary(dataset: Dataset) -> dict[str, Any]:
    """Summarise a dataset as plain values for JSON, SI, without voltages of transients."""
    static, ranges = dataset.static, dataset.ranges
    voltages = [table.voltage for table in (static, dataset.frequencies, dataset.fields)
                if table is not None]
    voltages += [ranges.voltage_min, ranges.voltage_max] if ranges is not None else []
    scatter = repeat_noise(dataset)
    tests = dataset.coupons
    readings = {table.file.name: len(table) for table in dataset.sheets}
    readings |= Counter() if tests is None else Counter(tests.file.tolist())
    return {
        "dataset": dataset.name,
        "source": dataset.source,
        "files": [{"name": name, "sha256": sha256,
                   "readings": readings.get(name)}
                  for name, sha256 in dataset.files.items()],
        "specimens": [specimen.name for specimen in dataset.specimens],
        "masses_kg": _distinct([dataset.masses]) if _loaded(dataset) else [],
        "voltages_V": _distinct(voltages),
        "channels": [] if static is None else ["displacement", *channels(static)],
        "runs": len(dataset.runs),
        "hum": to_json([hum for run in dataset.runs for hum in run.hum]),
        "late_runs": to_json([late for run in dataset.runs for late in run.late]),
        "repeated_states": 0 if static is None
        else int((np.bincount(repeat_groups(static)) > 1).sum()),
        "noise": {
            "given_m": dataset.noise,
            "readings_with_their_own": 0 if static is None
            else int(np.isfinite(static.sigma).sum()),
            "found_m": None if scatter is None else {
                **dict(zip(("low", "high"), scatter.limits.tolist(), strict=True)),
                "value": scatter.size, "degrees_of_freedom": int(scatter.freedom[0])}},
        "findings": to_json(tuple(findings(dataset))),
        "warnings": dataset_warnings(dataset),
    }


def dataset_warnings(dataset: Dataset) -> list[str]:
    """Write one sentence for each fact that limits, or may spoil, conclusions from the data."""
    return [*dataset.remarks, *_too_little(dataset), *_static_warnings(dataset),
            *_frequency_warnings(dataset), *_run_warnings(dataset), *slips_of_unit(dataset),
            *slips_of_sign(dataset), *dataset.rig.remarks]


def _distinct(values: list[Array]) -> list[float]:
    return sorted({value for column in values for value in column.tolist()})


def _too_little(dataset: Dataset) -> Iterator[str]:
    tables = [table for table in (dataset.static, dataset.ranges) if table is not None]
    read = {name for table in dataset.sheets for name in table.specimen.tolist()}
    idle = [specimen.name for specimen in dataset.specimens if specimen.name not in read]
    if read and idle:
        yield WORDS["no_readings"].format(names=", ".join(idle))
    if not tables:
        return
    if len(read) == 1:
        yield WORDS["one_specimen"]
    if _loaded(dataset) and len(_distinct([table.mass for table in tables])) == 1:
        yield WORDS["one_mass"]
    static = dataset.static if dataset.ranges is None else None
    if static is not None and len(_distinct([static.voltage])) == 1:
        yield WORDS["one_voltage"]
    count = sum(map(len, tables))
    if count < 5:
        yield WORDS["few"].format(count=count)


def _static_warnings(dataset: Dataset) -> Iterator[str]:
    static = dataset.static
    if static is None:
        return
    yield from (finding.what for finding in findings(dataset))
    timed = np.isfinite(static.order) | np.isfinite(static.elapsed)
    if not timed.any() and dataset.transients is None:
        yield WORDS["no_times"]
    elif timed.any() and not timed.all():
        yield WORDS["some_times"].format(timed=timed.sum(), count=len(static))
    directions = set(static.direction.tolist()) - {""}
    if len(directions) == 1 or (not directions and timed.all() and _only_up(static)):
        yield WORDS["one_way"].format(way="down" if directions == {"down"} else "up")
    elif not directions:
        yield WORDS["no_direction"]
    if "down" in directions and dataset.rig.loading.softening:
        yield WORDS["snaps"]
    if dataset.noise is None and np.isnan(static.sigma).any() and repeat_noise(dataset) is None:
        repeats = (np.bincount(repeat_groups(static)) > 1).any()
        yield WORDS["rounded" if repeats else "no_noise"]
    if step := coarse_step(dataset):
        yield WORDS["steps"].format(step=1e6 * step)
    ratio = stated_ratio(dataset)
    if ratio is not None and not ratio.limits[0] <= 1 <= ratio.limits[1]:
        yield WORDS["scatter"].format(ratio=ratio.size, limits=ratio.limits)


def clock_runs_back(static: Sheet) -> int | None:
    """Find the first reading that the clock puts before the reading that precedes it by order.

    Only readings of one specimen under one mass in one run are compared: others may have another
    clock.
    """
    if not (np.isfinite(static.order).all() and np.isfinite(static.elapsed).all()):
        return None
    last: dict[tuple[object, ...], float] = {}
    rows: list[int] = np.argsort(static.order, kind="stable").tolist()
    for row in rows:
        run = static.specimen[row], static.mass[row], static.run[row]
        if static.elapsed[row] < last.get(run, -np.inf):
            return row
        last[run] = float(static.elapsed[row])
    return None


def findings(dataset: Dataset) -> Iterator[Finding]:
    """Yield faults of rows, sensor or clock, how they are handled and what to do about them."""
    if dataset.static is None:
        return
    for found in FINDERS:
        for finding in found(dataset, dataset.static):
            yield replace(finding, check=WORDS[f"do_{finding.kind}"])


def _pasted(dataset: Dataset, static: Sheet) -> Iterator[Finding]:
    """Yield rows that are copies of others."""
    file = static.file.name
    for rows, of in _blocks(dataset.copies):
        lines = static.line[rows]
        yield Finding("copies", WORDS["copies"].format(
            file=file, lines=lines_of(lines), of=lines_of(static.line[of]),
            s="" if len(rows) > 1 else "s"), file, tuple(lines.tolist()))


def _off_their_ramps(dataset: Dataset, static: Sheet) -> Iterator[Finding]:
    """Yield readings far off the curve of their ramp."""
    file = static.file.name
    used = np.flatnonzero(np.isfinite(static.displacement) & ~dataset.unused)
    for one in outliers(static, used, dataset.noise):
        how = one.how and WORDS[f"outlier_{one.how}"].format(
            way="large" if abs(one.read) > abs(one.expected) else "small")
        line = int(static.line[one.row])
        yield Finding("outlier", WORDS["outlier"].format(
            file=file, line=line, read=1e3 * one.read, expected=1e3 * one.expected, how=how),
            file, (line,))


def _at_the_end(dataset: Dataset, static: Sheet) -> Iterator[Finding]:
    """Yield readings of a sensor at the end of its range."""
    stuck = at_sensor_end(static)
    if not stuck.any():
        return
    low, high = static.displacement[stuck].min(), static.displacement[stuck].max()
    key = "saturated" if low == high else "near_end"
    lines = static.line[stuck]
    yield Finding("sensor_end", WORDS[key].format(
        count=int(stuck.sum()), low=1e3 * low, value=1e3 * high, line=int(lines[0])),
        static.file.name, tuple(lines.tolist()))


def _backwards(dataset: Dataset, static: Sheet) -> Iterator[Finding]:
    """Yield the reading from which a clock runs back."""
    row = clock_runs_back(static)
    if row is not None:
        line = int(static.line[row])
        yield Finding("clock", WORDS["clock_back"].format(
            line=line, time=float(static.elapsed[row])), static.file.name, (line,))


def _moved_zeros(dataset: Dataset, static: Sheet) -> Iterator[Finding]:
    """Yield runs whose zeros differ from that of the first run."""
    moved = dataset.run_zeros
    if moved is None:
        return
    file = static.file.name
    for run, zero in moved.pairs():
        yield Finding("run_zero", WORDS["run_zero"].format(
            file=file, run=run or WORDS["no_run"], first=moved.runs[0] or WORDS["no_run"],
            zero=1e6 * abs(zero), way="more" if zero > 0 else "less", moved=moved,
            error=2e6 * moved.error, size=1e6 * moved.size), file,
            tuple(static.line[static.run == run].tolist()))


#: Functions that find faults in static readings before a film is solved, in the order of reporting.
#: A new one is a function here, and its kind in :class:`Finding`.
FINDERS: tuple[Callable[[Dataset, Sheet], Iterator[Finding]], ...] = (
    _pasted, _off_their_ramps, _at_the_end, _backwards, _moved_zeros)


def _blocks(copies: CopiedRows) -> Iterator[tuple[Numbers, Numbers]]:
    """Yield blocks of consecutive copies, and the rows they are copies of."""
    rows, of = copies.rows, copies.of
    breaks = np.flatnonzero((np.diff(rows) != 1) | (np.abs(np.diff(of)) > 1)) + 1
    for part in np.split(np.arange(len(rows)), breaks):
        if len(part):
            yield rows[part], of[part]


def lines_of(lines: Numbers) -> str:
    """Write lines in words: "line 12", "lines 12 to 21"."""
    low, high = int(lines.min()), int(lines.max())
    return f"line {low}" if low == high else f"lines {low} to {high}"


def _frequency_warnings(dataset: Dataset) -> Iterator[str]:
    read = dataset.frequencies
    if read is None:
        return
    if len(set(zip(read.specimen.tolist(), read.mass.tolist(), strict=True))) == 1:
        yield WORDS["one_load_swings"]
    light = [specimen.name for specimen in dataset.specimens
             if specimen.name in read.specimen and not specimen.membrane.density]
    if light:
        yield WORDS["massless"].format(names=", ".join(light))


def _run_warnings(dataset: Dataset) -> Iterator[str]:
    """Yield warnings of hum in runs in time, by its frequency, and of clocks that are off."""
    if dataset.transients is None:
        return
    file, count = dataset.transients.file.name, len(dataset.runs)
    lines = [(run.record.name, hum) for run in dataset.runs for hum in run.hum]
    by_frequency: dict[tuple[bool, float], list[tuple[str, Hum]]] = {}
    for name, hum in sorted(lines, key=lambda item: -item[1].amplitude_um):
        by_frequency.setdefault((hum.mains, round(hum.frequency_Hz)), []).append((name, hum))
    for (mains, _), some in by_frequency.items():
        names = sorted({name for name, _ in some})
        where = f"all {count} runs" if len(names) == count > 1 else "; ".join(names)
        hum = some[0][1]
        folded = abs(hum.seen_Hz - hum.frequency_Hz) > _FOLDED * hum.frequency_Hz
        low = min(each.low_um for _, each in some)
        high = max(each.high_um or np.inf for _, each in some)
        amplitude = WORDS["between" if high < np.inf else "at_least"].format(low=low, high=high)
        yield WORDS["mains" if mains else "line"].format(
            file=file, frequency=hum.frequency_Hz, runs=where, amplitude=amplitude,
            folded=WORDS["folded"].format(seen=hum.seen_Hz) if folded else "")
    for run in dataset.runs:
        for late in run.late:
            sign = 1 if late.late_s > 0 else -1
            low, high = sorted((abs(late.low_s), abs(late.high_s)))
            yield WORDS["late" if sign > 0 else "early"].format(
                file=file, name=run.record.name, time=abs(late.late_s), low=low, high=high)


def _only_up(static: Sheet) -> bool:
    """Check that no voltage of a specimen, mass, run and repeat is below the one before."""
    when = static.order if np.isfinite(static.order).all() else static.elapsed
    last: dict[tuple[object, ...], float] = {}
    for row in np.argsort(when, kind="stable"):
        ramp = (static.specimen[row], static.mass[row], static.run[row], static.repeat[row],
                static.drive[row])
        if static.voltage[row] < last.get(ramp, 0.0):
            return False
        last[ramp] = static.voltage[row]
    return True


def slips_of_unit(dataset: Dataset) -> Iterator[str]:
    """Find numbers a thousand times too large or small for actuators of this size."""
    for name, table in dataset.tables.items():
        if not isinstance(table, Sheet):
            continue
        for specimen in dataset.specimens:
            rows = table.specimen == specimen.name
            for column, limits in _limits(specimen).items():
                if column in table.values and rows.any():
                    yield from _slips_of_column(table, name, column, specimen.name, limits)
    yield from _slips_of_frequency(dataset)
    if dataset.coupons is not None:
        yield from _slips_of_coupons(dataset.coupons)


def _slips_of_column(table: Sheet, file: str, column: str, specimen: str,
                     limits: tuple[float, float, str, float]) -> Iterator[str]:
    """Find a wrong unit of all readings of a specimen, else of those under one mass.

    The lower limit scales with the mass for readings under a small mass.
    """
    low, high, unit, factor = limits
    here, masses = table.specimen == specimen, table.values.get("mass", np.zeros(len(table)))
    heaviest = float(masses[here].max()) or 1.0
    groups = [(here, 1.0, "")] + [
        (here & (masses == mass), mass / heaviest, f" under {1e3 * mass:.4g} g")
        for mass in np.unique(masses[here]).tolist()]
    for rows, share, under in groups:
        largest = float(np.abs(np.nan_to_num(table[column][rows])).max())
        if largest and not low * share <= largest <= high:
            yield WORDS["slip"].format(
                file=file, column=column, specimen=f"{specimen}{under}", unit=unit,
                largest=largest * factor, low=low * share * factor, high=high * factor)
            return


def _slips_of_coupons(coupons: Coupons) -> Iterator[str]:
    """Find strains given as stretches, and kelvins given as degrees Celsius."""
    short = coupons.stretch < _SHORT
    if short.sum() >= _SEVERAL and np.mean(coupons.stress[short] > 0) > 0.5:
        yield WORDS["strain"].format(count=int(short.sum()), short=_SHORT)
    if coupons.degrees.min() > _HOT:
        yield WORDS["kelvin"].format(lowest=float(coupons.degrees.min()))


def slips_of_sign(dataset: Dataset) -> Iterator[str]:
    """Find deflections that fall wherever the voltage of their film rises.

    If they fall under heavier masses too, the readings are a sensor's distance from the plate, or
    on an axis that points up. If not, no film loaded by a weight behaves so. The warning is given
    for all films, or for one film among others.
    """
    yield from _against_gas(dataset)
    static, rig = dataset.static, dataset.rig
    if static is None or rig.gas_pressure or rig.biases:
        return
    ramps = [ramp for ramp in _ramps(static) if len(np.unique(ramp.voltage)) >= _FEWEST]
    films = [[ramp for ramp in ramps if ramp.name == name]
             for name in dict.fromkeys(ramp.name for ramp in ramps)]
    falling = [film for film in films if all(ramp.falls for ramp in film)]
    alike = len(falling) == len(films)
    for told in [ramps] if alike and ramps else falling:
        heavier = [(light, heavy) for light, heavy in pairwise(told) if light.name == heavy.name]
        up = all(heavy.read.max() < light.read.max() for light, heavy in heavier)
        far = all(np.ptp(ramp.read) > _LIFTED * np.abs(ramp.read).max() for ramp in told)
        if not far and not (up and alike):
            continue
        ramp, ends = told[0], np.argsort(told[0].voltage, kind="stable")[[0, -1]]
        yield WORDS["falls" if up else "lifts"].format(
            specimen=ramp.name, mass=1e3 * ramp.mass, read=1e3 * ramp.read[ends],
            voltage=1e-3 * ramp.voltage[ends], whose="" if alike else f" of {ramp.name}",
            what="voltage and mass rise" if heavier else "the voltage rises",
            others="" if alike else ", but that of other films rises",
            remedy=WORDS["do_sign" if alike else "do_sign_of_one"])


def _loaded(dataset: Dataset) -> bool:
    """Check whether some film has a plate, which can carry masses."""
    return any(specimen.plate is not None for specimen in dataset.specimens)


def _against_gas(dataset: Dataset) -> Iterator[str]:
    """Find films without plate whose centres always move against gas pressure and weight."""
    read = [(sheet, sheet.values[name]) for sheet, name in (
        (dataset.static, "displacement"), (dataset.ranges, "range")) if sheet is not None]
    for specimen in dataset.specimens:
        if specimen.plate is not None:
            continue
        film, rig = specimen.membrane, dataset.rig
        weighed = film.density * film.volume_per_area + film.layers * specimen.electrode.mass
        pressure = rig.gas_pressure - weighed * rig.gravity
        for sheet, values in read:
            there = values[(sheet.specimen == specimen.name) & np.isfinite(values) & (values != 0)]
            if len(there) and pressure and (there * pressure > 0).all():
                yield WORDS["against_gas"].format(
                    file=sheet.file.name, specimen=specimen.name, pressure=rig.gas_pressure,
                    way="lifts" if pressure > 0 else "lowers",
                    sign="negative" if pressure > 0 else "positive", read=1e3 * there[0])


class _Ramp(NamedTuple):
    """Voltages [V] and deflections [m] of a specimen under a mass [kg]."""

    name: str
    mass: float
    voltage: Array
    read: Array

    @property
    def falls(self) -> bool:
        """Whether deflections fall as the square of the voltage rises."""
        return bool(np.ptp(self.read) > 0
                    and np.corrcoef(self.voltage**2, self.read)[0, 1] < _FALLS)


def _ramps(static: Sheet) -> list[_Ramp]:
    """List ramps by specimen and mass."""
    loads = sorted(set(zip(static.specimen.tolist(), static.mass.tolist(), strict=True)))
    rows = [(static.specimen == name) & (static.mass == mass) for name, mass in loads]
    return [_Ramp(*load, static.voltage[there], static.displacement[there])
            for load, there in zip(loads, rows, strict=True)]


def _slips_of_frequency(dataset: Dataset) -> Iterator[str]:
    """Find frequencies that a plate with that static deflection cannot have.

    A mass on a spring has 2πf = √(g/y); rad/s read as Hz are 6.3 times as many, rpm 60 times.
    """
    read, static, rig = dataset.frequencies, dataset.static, dataset.rig
    if read is None or static is None or rig.gas_pressure or rig.biases:
        return
    for specimen in dataset.specimens:
        here, there = read.specimen == specimen.name, static.specimen == specimen.name
        loads = set(read.mass[here].tolist()) & set(static.mass[there].tolist())
        for mass in sorted(loads):
            low = static.displacement[there & (static.mass == mass)].min()
            largest = float(read.frequency[here & (read.mass == mass)].max())
            usual = float(np.sqrt(rig.gravity / max(low, 1e-9))) / (2 * np.pi)
            if not usual / _APART < largest < usual * _APART:
                yield WORDS["no_frequency"].format(specimen=specimen.name, largest=largest,
                                                   usual=usual, mass=1e3 * mass)


def _limits(specimen: Specimen) -> dict[str, tuple[float, float, str, float]]:
    """Give the largest possible number of a column [SI], a unit to print it in, and its factor."""
    film, size = specimen.membrane, max(specimen.frame.semi_axes)
    thickness = film.thickness / film.area_prestretch
    voltage = _FIELDS[0] * thickness, _FIELDS[1] * thickness, "kV", 1e-3
    length = 1e-4 * size, size, "mm", 1e3
    whole = EPSILON_0 * film.relative_permittivity * area(specimen.frame) * film.layers / thickness
    return {"mass": (1e-4, 5.0, "g", 1e3), "voltage": voltage, "voltage_max": voltage,
            "film_voltage": voltage, "displacement": length, "range": length,
            "capacitance": (whole / _CAPACITIES, whole * _CAPACITIES, "pF", 1e12)}
