"""What is in a dataset, and what to beware of before anything is concluded from it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from tympan.geometry.specimen import Specimen
from tympan.studies.data.dataset import Dataset
from tympan.studies.data.noise import repeat_groups, repeat_noise, stated_ratio
from tympan.studies.data.readings import Array, StaticReadings

#: Fields in the mounted film between which the largest voltage is no slip of a unit [V/m]. Below,
#: the Maxwell stress is under 1 Pa; VHB, the strongest film of the library, breaks down far before
#: the upper one (tympan.fem.film.breakdown).
_FIELDS = (1e5, 1e9)


def summary(dataset: Dataset) -> dict[str, Any]:
    """What a dataset holds, as plain values for JSON, SI; voltages of transients are left out."""
    static, ranges = dataset.static, dataset.ranges
    loads = [table for table in (static, ranges, dataset.transients) if table is not None]
    voltages = [static.voltage] if static is not None else []
    voltages += [ranges.voltage_min, ranges.voltage_max] if ranges is not None else []
    return {
        "dataset": dataset.name,
        "source": dataset.source,
        "files": [{"name": file.name, "sha256": file.sha256,
                   "readings": len(dataset.tables[file.name]) if file.name in dataset.tables
                   else None}
                  for file in dataset.files],
        "specimens": [specimen.name for specimen in dataset.specimens],
        "masses_kg": _distinct([table.mass for table in loads]),
        "voltages_V": _distinct(voltages),
        "channels": [] if static is None else ["displacement", *static.channels],
        "runs": 0 if dataset.transients is None else len({*zip(
            dataset.transients.specimen.tolist(), dataset.transients.mass.tolist(),
            dataset.transients.run.tolist(),
            strict=True)}),
        "repeated_states": 0 if static is None
        else int((np.bincount(repeat_groups(static)) > 1).sum()),
        "noise": _noise(dataset),
        "warnings": dataset_warnings(dataset),
    }


def dataset_warnings(dataset: Dataset) -> list[str]:
    """One sentence for each thing that limits, or may spoil, what the data can tell."""
    checks: tuple[Callable[[Dataset], Iterator[str]], ...] = (
        _unused, _too_little, _ramps, _noise_warnings, slips_of_unit)
    return [*dataset.remarks, *(words for check in checks for words in check(dataset))]


def _distinct(values: list[Array]) -> list[float]:
    return sorted({value for column in values for value in column.tolist()})


def _noise(dataset: Dataset) -> dict[str, Any]:
    """Noise given and noise found [m]; None where there is none."""
    found, static = repeat_noise(dataset), dataset.static
    own = 0 if static is None else int(np.isfinite(static.sigma).sum())
    return {"given_m": dataset.noise, "readings_with_their_own": own,
            "found_m": None if found is None else
            {"value": found.sigma, "low": found.low, "high": found.high,
             "degrees_of_freedom": found.freedom}}


def _actuators(dataset: Dataset) -> set[str]:
    """Specimens that have readings."""
    tables = (dataset.static, dataset.ranges, dataset.transients)
    return {name for table in tables if table is not None for name in table.specimen.tolist()}


def _unused(dataset: Dataset) -> Iterator[str]:
    seen = _actuators(dataset)
    idle = [specimen.name for specimen in dataset.specimens if specimen.name not in seen]
    if seen and idle:
        yield f"no readings of {', '.join(idle)}"


def _too_little(dataset: Dataset) -> Iterator[str]:
    tables = [table for table in (dataset.static, dataset.ranges) if table is not None]
    if not tables:
        return
    if len(_actuators(dataset)) == 1:
        yield "one specimen only: what the shape does cannot be told from what the specimen does"
    if len(_distinct([table.mass for table in tables])) == 1:
        yield "one mass only: what grows with the load cannot be told from what is always there"
    static = dataset.static if dataset.ranges is None else None
    if static is not None and len(_distinct([static.voltage])) == 1:
        yield "one voltage only: what the voltage does cannot be seen"
    if sum(map(len, tables)) < 5:
        yield (f"{sum(map(len, tables))} readings only: stiffness and permittivity alone take two "
               "of them")


def _ramps(dataset: Dataset) -> Iterator[str]:
    static = dataset.static
    if static is None:
        return
    timed = np.isfinite(static.order) | np.isfinite(static.elapsed)
    if not timed.any():
        yield ("neither order nor elapsed_s is recorded: drift and creep cannot be told from the "
               "voltage's effect")
    elif not timed.all():
        yield f"order and elapsed_s are recorded for {timed.sum()} of {len(static)} readings only"
    directions = set(static.direction.tolist()) - {""}
    if len(directions) == 1 or (not directions and timed.all() and _only_up(static)):
        yield (f"only {'up' if directions != {'down'} else 'down'} ramps: creep looks like an "
               "effect of the voltage; "
               "measure the way back too")
    elif not directions:
        yield ("direction is not recorded: if the voltage went up and down, hysteresis counts as "
               "noise")


def _only_up(static: StaticReadings) -> bool:
    """Whether no voltage of a specimen, mass, run and repeat is below the one read before."""
    when = static.order if np.isfinite(static.order).all() else static.elapsed
    last: dict[tuple[object, ...], float] = {}
    for row in np.argsort(when, kind="stable"):
        ramp = static.specimen[row], static.mass[row], static.run[row], static.repeat[row]
        if static.voltage[row] < last.get(ramp, 0.0):
            return False
        last[ramp] = static.voltage[row]
    return True


def _noise_warnings(dataset: Dataset) -> Iterator[str]:
    static = dataset.static
    if static is None:
        return
    bare = dataset.noise is None and bool(np.isnan(static.sigma).any())
    repeats = bool((np.bincount(repeat_groups(static)) > 1).any())
    if bare and repeat_noise(dataset) is None:
        yield ("repeats agree to the last digit, which measures the rounding, not the noise: give "
               "noise in dataset.toml"
               if repeats
               else "nothing repeats and no noise is given: a misfit cannot be judged without it; "
                    "repeat "
               "some readings, or give noise in dataset.toml")
    ratio = stated_ratio(dataset)
    if ratio is not None and not ratio.low <= 1 <= ratio.high:
        yield (f"repeats scatter by {ratio.sigma:.3g} times the stated noise "
               f"(95 %: {ratio.low:.3g} to {ratio.high:.3g})")


def slips_of_unit(dataset: Dataset) -> Iterator[str]:
    """Numbers a thousand times too large or small for actuators of this size."""
    for name, table in dataset.tables.items():
        for specimen in dataset.specimens:
            rows = np.asarray(table.specimen == specimen.name)
            if name != "coupon.csv" and rows.any():
                for column in ("mass", "voltage", "voltage_max", "displacement", "range"):
                    if hasattr(table, column):
                        largest = float(np.abs(np.nan_to_num(getattr(table, column)[rows])).max())
                        yield from _slip(name, specimen, column, largest)


def _slip(name: str, specimen: Specimen, column: str, largest: float) -> Iterator[str]:
    """A warning if the largest value of a column [SI] is outside what its quantity can be."""
    film, size = specimen.membrane, max(specimen.frame.semi_axes)
    thickness = film.thickness / film.area_prestretch
    limits = {"mass": (1e-4, 5.0, "g", 1e3),
              "voltage": (_FIELDS[0] * thickness, _FIELDS[1] * thickness, "kV", 1e-3),
              "displacement": (1e-4 * size, size, "mm", 1e3)}
    low, high, unit, factor = limits[{"voltage_max": "voltage",
                                      "range": "displacement"}.get(column, column)]
    if largest and not low <= largest <= high:
        yield (f"{name}: the largest {column} of {specimen.name} is {largest * factor:.4g} "
               f"{unit}, where "
               f"{low * factor:.2g} to {high * factor:.4g} {unit} can be: is the unit in the "
               "column's name right?")
