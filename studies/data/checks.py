"""What is in a dataset, and what to beware of before anything is concluded from it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.specimen import Specimen
from tympan.studies.columns import Sheet
from tympan.studies.data.dataset import Dataset, channels
from tympan.studies.data.noise import repeat_groups, repeat_noise, stated_ratio

#: Fields in the mounted film between which the largest voltage is no slip of a unit [V/m]. Below,
#: the Maxwell stress is under 1 Pa; VHB, the strongest film of the library, breaks down far before
#: the upper one (tympan.fem.film.breakdown).
_FIELDS = (1e5, 1e9)


def summary(dataset: Dataset) -> dict[str, Any]:
    """What a dataset holds, as plain values for JSON, SI; voltages of transients are left out."""
    static, ranges, transients = dataset.static, dataset.ranges, dataset.transients
    loads = [table for table in (static, ranges, transients) if table is not None]
    voltages = [static.voltage] if static is not None else []
    voltages += [ranges.voltage_min, ranges.voltage_max] if ranges is not None else []
    runs = [] if transients is None else zip(*(
        transients[name].tolist() for name in ("specimen", "mass", "run")), strict=True)
    scatter = repeat_noise(dataset)
    return {
        "dataset": dataset.name,
        "source": dataset.source,
        "files": [{"name": name, "sha256": sha256,
                   "readings": len(dataset.tables[name]) if name in dataset.tables else None}
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
    checks: tuple[Callable[[Dataset], Iterator[str]], ...] = (
        _too_little, _ramps, _noise_warnings, slips_of_unit)
    return [*dataset.remarks, *(words for check in checks for words in check(dataset))]


def _distinct(values: list[NDArray[np.float64]]) -> list[float]:
    return sorted({value for column in values for value in column.tolist()})


def _too_little(dataset: Dataset) -> Iterator[str]:
    tables = [table for table in (dataset.static, dataset.ranges) if table is not None]
    read = {name for table in (*tables, dataset.transients) if table is not None
            for name in table.specimen.tolist()}
    idle = [specimen.name for specimen in dataset.specimens if specimen.name not in read]
    if read and idle:
        yield f"no readings of {', '.join(idle)}"
    if not tables:
        return
    if len(read) == 1:
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
               "effect of the voltage; measure the way back too")
    elif not directions:
        yield ("direction is not recorded: if the voltage went up and down, hysteresis counts as "
               "noise")


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


def _noise_warnings(dataset: Dataset) -> Iterator[str]:
    static = dataset.static
    if static is None:
        return
    bare = dataset.noise is None and bool(np.isnan(static.sigma).any())
    repeats = bool((np.bincount(repeat_groups(static)) > 1).any())
    if bare and repeat_noise(dataset) is None:
        yield ("repeats agree to the last digit, which measures the rounding, not the noise: give "
               "noise in dataset.toml"
               if repeats else
               "nothing repeats and no noise is given: a misfit cannot be judged without it; "
               "repeat some readings, or give noise in dataset.toml")
    ratio = stated_ratio(dataset)
    if ratio is not None and not ratio.low <= 1 <= ratio.high:
        yield (f"repeats scatter by {ratio.sigma:.3g} times the stated noise (95 %: "
               f"{ratio.low:.3g} to {ratio.high:.3g})")


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
                    yield (f"{name}: the largest {column} of {specimen.name} is "
                           f"{largest * factor:.4g} {unit}, where {low * factor:.2g} to "
                           f"{high * factor:.4g} {unit} can be: is the unit in the column's name "
                           "right?")


def _limits(specimen: Specimen) -> dict[str, tuple[float, float, str, float]]:
    """What the largest number of a column [SI] can be, a unit to say it in, and its factor."""
    film, size = specimen.membrane, max(specimen.frame.semi_axes)
    thickness = film.thickness / film.area_prestretch
    voltage = _FIELDS[0] * thickness, _FIELDS[1] * thickness, "kV", 1e-3
    length = 1e-4 * size, size, "mm", 1e3
    return {"mass": (1e-4, 5.0, "g", 1e3), "voltage": voltage, "voltage_max": voltage,
            "displacement": length, "range": length}
