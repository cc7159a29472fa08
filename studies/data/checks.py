"""What is in a dataset, and what to beware of before anything is concluded from it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.specimen import Specimen
from tympan.studies.columns import Sheet
from tympan.studies.data.dataset import Dataset, channels
from tympan.studies.data.noise import repeat_groups, repeat_noise, stated_ratio
from tympan.studies.files import words_beside

#: What to beware of, by key.
WORDS = words_beside(__file__)

#: Fields in the mounted film between which the largest voltage is no slip of a unit [V/m]. Below,
#: the Maxwell stress is under 1 Pa; VHB, the strongest film of the library, breaks down far before
#: the upper one (tympan.fem.film.breakdown).
_FIELDS = (1e5, 1e9)

#: Factor beyond which a frequency is none of a weight on a spring that gives way so far: films
#: stiffen, and mass is missing, by less.
_APART = 4.0


def summary(dataset: Dataset) -> dict[str, Any]:
    """What a dataset holds, as plain values for JSON, SI; voltages of transients are left out."""
    static, ranges, transients = dataset.static, dataset.ranges, dataset.transients
    frequencies, fields = dataset.frequencies, dataset.fields
    loads = [table for table in (static, ranges, transients, frequencies, fields)
             if table is not None]
    voltages = [table.voltage for table in (static, frequencies, fields) if table is not None]
    voltages += [ranges.voltage_min, ranges.voltage_max] if ranges is not None else []
    runs = [] if transients is None else zip(*(
        transients[name].tolist() for name in ("specimen", "mass", "run")), strict=True)
    scatter = repeat_noise(dataset)
    readings = {Path(name).stem: len(table) for name, table in dataset.tables.items()}
    return {
        "dataset": dataset.name,
        "source": dataset.source,
        "files": [{"name": name, "sha256": sha256, "readings": readings.get(Path(name).stem)}
                  for name, sha256 in dataset.files.items()],
        "specimens": [specimen.name for specimen in dataset.specimens],
        "masses_kg": _distinct([table.mass for table in loads]),
        "voltages_V": _distinct(voltages),
        "channels": [] if static is None else ["displacement", *channels(static)],
        "runs": len({*runs}),
        "repeated_states": 0 if static is None
        else int((np.bincount(repeat_groups(static)) > 1).sum()),
        "noise": {
            "given_m": dataset.noise,
            "readings_with_their_own": 0 if static is None
            else int(np.isfinite(static.sigma).sum()),
            "found_m": None if scatter is None else {
                "value": scatter.sigma, "low": scatter.low, "high": scatter.high,
                "degrees_of_freedom": scatter.freedom}},
        "warnings": dataset_warnings(dataset),
    }


def dataset_warnings(dataset: Dataset) -> list[str]:
    """One sentence for each thing that limits, or may spoil, what the data can tell."""
    return [*dataset.remarks, *_too_little(dataset), *_static_warnings(dataset),
            *_frequency_warnings(dataset), *slips_of_unit(dataset)]


def _distinct(values: list[NDArray[np.float64]]) -> list[float]:
    return sorted({value for column in values for value in column.tolist()})


def _too_little(dataset: Dataset) -> Iterator[str]:
    tables = [table for table in (dataset.static, dataset.ranges) if table is not None]
    others = dataset.transients, dataset.frequencies, dataset.fields
    read = {name for table in (*tables, *others) if table is not None
            for name in table.specimen.tolist()}
    idle = [specimen.name for specimen in dataset.specimens if specimen.name not in read]
    if read and idle:
        yield WORDS["no_readings"].format(names=", ".join(idle))
    if not tables:
        return
    if len(read) == 1:
        yield WORDS["one_specimen"]
    if len(_distinct([table.mass for table in tables])) == 1:
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
    if dataset.noise is None and np.isnan(static.sigma).any() and repeat_noise(dataset) is None:
        repeats = (np.bincount(repeat_groups(static)) > 1).any()
        yield WORDS["rounded" if repeats else "no_noise"]
    ratio = stated_ratio(dataset)
    if ratio is not None and not ratio.low <= 1 <= ratio.high:
        yield WORDS["scatter"].format(ratio=ratio)


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


def _only_up(static: Sheet) -> bool:
    """Whether no voltage of a specimen, mass, run and repeat is below the one read before."""
    when = static.order if np.isfinite(static.order).all() else static.elapsed
    last: dict[tuple[object, ...], float] = {}
    for row in np.argsort(when, kind="stable"):
        ramp = static.specimen[row], static.mass[row], static.run[row], static.repeat[row]
        if static.voltage[row] < last.get(ramp, 0.0):
            return False
        last[ramp] = static.voltage[row]
    return True


def slips_of_unit(dataset: Dataset) -> Iterator[str]:
    """Numbers a thousand times too large or small for actuators of this size."""
    for name, table in dataset.tables.items():
        if not isinstance(table, Sheet):
            continue
        for specimen in dataset.specimens:
            rows = table.specimen == specimen.name
            for column, (low, high, unit, factor) in _limits(specimen).items():
                if column not in table.values or not rows.any():
                    continue
                largest = float(np.abs(np.nan_to_num(table[column][rows])).max())
                if largest and not low <= largest <= high:
                    yield WORDS["slip"].format(
                        file=name, column=column, specimen=specimen.name, unit=unit,
                        largest=largest * factor, low=low * factor, high=high * factor)
    yield from _slips_of_frequency(dataset)


def _slips_of_frequency(dataset: Dataset) -> Iterator[str]:
    """Frequencies that a plate at rest so far down cannot have.

    A weight on a spring has 2πf = √(g/y); rad/s for Hz are 6.3 times as many, rpm 60.
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
    """What the largest number of a column [SI] can be, a unit to say it in, and its factor."""
    film, size = specimen.membrane, max(specimen.frame.semi_axes)
    thickness = film.thickness / film.area_prestretch
    voltage = _FIELDS[0] * thickness, _FIELDS[1] * thickness, "kV", 1e-3
    length = 1e-4 * size, size, "mm", 1e3
    return {"mass": (1e-4, 5.0, "g", 1e3), "voltage": voltage, "voltage_max": voltage,
            "displacement": length, "range": length}
