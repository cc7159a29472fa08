"""Numbers often mistaken for others: a unit, a diameter, a stretch, a thickness.

No film is ten times as stiff as stated, but people write centimetres into a column of millimetres.
So where the fitted factors are far from those of the stated film, each quantity that is often
confused is read as the other one, and the films are fitted again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from math import log
from typing import Any

import numpy as np
from scipy.special import chdtrc

from tympan.base.arrays import Array, Mask
from tympan.base.constants import STANDARD_GRAVITY
from tympan.base.errors import InputError
from tympan.geometry.specimen import Film, Specimen
from tympan.studies.data.dataset import Dataset
from tympan.studies.data.findings import Finding
from tympan.studies.diagnosis.calibration import calibrated
from tympan.studies.diagnosis.evidence.kind import PreparedReadings
from tympan.studies.diagnosis.explanations.kind import Explanation, Written
from tympan.studies.diagnosis.fits.fit import NUISANCE, Fit
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import FACTORS
from tympan.studies.diagnosis.inference.verdict import UNUSUAL, Judgement
from tympan.studies.diagnosis.inference.weighing import EXCLUDED, MORE, most_of_noise, unlikely
from tympan.studies.diagnosis.reading_table import LENGTHS, ReadingTable
from tympan.studies.diagnosis.sentences import WORDS, listed
from tympan.studies.effects import Setup

#: Prior probability from which factors are those of an ordinary film.
_ORDINARY = 0.05

#: Share of the largest displacement below which a displacement counts as zero.
_NOTHING = 0.02

#: Units in which a number may be written, whatever its column says [SI].
_LENGTHS = {"micrometres": 1e-6, "millimetres": 1e-3, "centimetres": 1e-2, "metres": 1.0,
            "inches": 25.4e-3}
#: Units of a load: weights are mistaken for masses.
_LOADS = {"grams": 1e-3, "kilograms": 1.0, "ounces": 28.349523e-3,
          "millinewtons": 1e-3 / STANDARD_GRAVITY, "newtons": 1 / STANDARD_GRAVITY}
#: Units of a force: masses are mistaken for weights.
_FORCES = {"millinewtons": 1e-3, "newtons": 1.0, "grams": 1e-3 * STANDARD_GRAVITY}
#: Units of a voltage.
_VOLTAGES = {"volts": 1.0, "kilovolts": 1e3}

#: For each column: the units it may be in, and the powers of its factor in the factors on stiffness
#: and permittivity, for small deflections.
_COLUMNS: dict[str, tuple[dict[str, float], tuple[float, float]]] = {
    "displacement": (_LENGTHS, (-1.0, -1.0)),
    "range": (_LENGTHS, (-1.0, -1.0)),
    "mass": (_LOADS, (1.0, 1.0)),
    "force": (_FORCES, (1.0, 1.0)),
    "voltage": (_VOLTAGES, (0.0, -2.0)),
}


@dataclass(frozen=True)
class Confusion:
    """A quantity that was written as if it were another, in words.

    ``of``: the column and file, or the key of the specimens; ``taken``: how it is read; ``check``:
    the key of the sentence on what to do about it.
    """

    of: str
    taken: str
    check: str = "do_quantity"


@dataclass(frozen=True, eq=False)
class _Other:
    """Readings and specimens with one quantity read as another, or as stated.

    ``shift``: change of the logarithms of both factors at small deflections, None where only a fit
    can find it; ``larger``: sum over the readings of the logarithm of the factor on them.
    """

    setup: Setup
    table: ReadingTable
    confusion: Confusion = Confusion("", "")
    shift: Array | None = None
    larger: float = 0.0

    def unlikely(self, chi_squared: float) -> float:
        """Compute minus twice the log probability of the readings where a fit leaves this χ².

        Their scatter determines the noise, together with the stated noise, which counts as a few
        readings. So a wrong unit of readings differs from a wrong unit of loads, although both
        change the stiffness in the same way.
        """
        known = float(self.table.noise.freedom.sum())
        return unlikely(chi_squared, len(self.table), known) - 2 * self.larger


def mistaken_quantity(judged: Judgement, written: Written | None = None) -> Explanation | None:
    """Find quantities that, read as others often mistaken for them, make the film ordinary."""
    films = judged.of_first()
    if written is None or not films.simulation.loaded:
        return None
    readings, confusions = written.readings, tuple[Confusion, ...]()
    if judged.unusual:
        stated = fit(judged.simulation, (), readings.table, judged.nominal.unknowns)
        confusions = confusions_of(written.dataset, readings, stated)
    elif judged.weighed.odd_specimen:
        confusions = mistaken_sizes(readings.setup, films)
    if not confusions:
        return None
    factors = np.exp((judged.chosen or judged.nominal).unknowns[FACTORS])
    reads = listed([WORDS["reads"].format(confusion=one) for one in confusions], "or")
    key = "confused" if judged.unusual else "mistaken"
    return Explanation.of(Finding("quantity", WORDS[key].format(reads=reads, factors=factors),
                                  check=WORDS[confusions[0].check]))


def confusions_of(dataset: Dataset, readings: PreparedReadings, nominal: Fit
                  ) -> tuple[Confusion, ...]:
    """Find confusions that make unusual factors ordinary and add no misfit; likeliest first.

    ``nominal``: the nominal model's fit to the readings with their noise as stated. Specimens of
    other sizes are tried only where no unit and no thickness makes the factors ordinary.
    """
    setup, table = readings.setup, readings.table
    as_stated = _Other(setup, table)
    quick = [*_readings(dataset, setup, table), *_thicknesses(setup, table),
             *_counted(dataset, setup, table)]
    near = [other for other in quick if other.shift is None or _may_be(nominal, other.shift)]
    most = as_stated.unlikely(nominal.chi_squared) + EXCLUDED
    return _ordinary(near, most) or _ordinary(_sizes(setup, table), most)


def mistaken_sizes(setup: Setup, judged: Judgement) -> tuple[Confusion, ...]:
    """Find mistaken sizes that reduce the misfit of one odd specimen to noise, factors ordinary."""
    table, which = judged.table, judged.weighed.odd_specimen
    noise = _Other(setup, table).unlikely(most_of_noise(len(table)))
    return _ordinary([*_thicknesses(setup, table, which), *_sizes(setup, table, which)], noise)


def _may_be(nominal: Fit, shift: Array) -> bool:
    """Check if shifted factors may be ordinary; a fit stopped at a bound may be further off."""
    logs = nominal.unknowns[FACTORS] + shift
    before = nominal.unknowns[FACTORS]
    short = nominal.stopped[FACTORS] & (np.sign(logs) != np.sign(before))
    return bool(chdtrc(2, np.sum((np.where(short, 0.0, logs) / NUISANCE) ** 2)) >= UNUSUAL)


def _ordinary(others: Iterable[_Other], most: float) -> tuple[Confusion, ...]:
    """Select those that fit with ordinary factors, nearly as probable as the best of them."""
    fitted = [(other, found) for other in others if (found := _fit(other)) is not None
              and found.usual >= _ORDINARY and other.unlikely(found.chi_squared) < most]

    def with_prior(one: tuple[_Other, Fit]) -> float:
        other, found = one
        of_factors = float(np.sum((found.unknowns[FACTORS] / NUISANCE) ** 2))
        return other.unlikely(found.chi_squared) + of_factors

    least = min(map(with_prior, fitted), default=np.inf)
    return tuple(other.confusion for other, found in sorted(fitted, key=with_prior)
                 if with_prior((other, found)) < least + MORE)


def _fit(other: _Other) -> Fit | None:
    """Fit the nominal model to all readings; None where it cannot reach all of them."""
    try:
        found = calibrated(other.setup, other.table)
    except (InputError, ArithmeticError):
        return None
    return found.fit if len(found.table) == len(other.table) else None


def _readings(dataset: Dataset, setup: Setup, table: ReadingTable) -> Iterator[_Other]:
    """Yield columns that may be in another unit than their name says."""
    for sheet in dataset.sheets:
        rows = table.file == sheet.file.name
        for column, (units, powers) in _COLUMNS.items():
            source = sheet.sources.get(column)
            if source is None or not rows.any():
                continue
            stated = abs(source.factor)
            for unit, size in units.items():
                factor = size / stated
                if abs(log(factor)) > 1e-3 and (changed := _scaled(
                        setup, table, rows, column, factor)) is not None:
                    read = float(np.sum(rows & (table.kind == column)))
                    of = f"{sheet.heading(column)} of {sheet.file.name}"
                    yield _Other(setup, changed, Confusion(of, f"in {unit}"),
                                 log(factor) * np.array(powers), read * log(factor))


def _counted(dataset: Dataset, setup: Setup, table: ReadingTable) -> Iterator[_Other]:
    """Yield displacements counted from the loaded plate: without voltage all are zero."""
    states = table.states
    for sheet in dataset.sheets:
        rows = np.flatnonzero((table.file == sheet.file.name) & (table.kind == "displacement")
                              & (table.since < 0) & np.isnan(states.deflection[table.state]))
        at = table.state[rows]
        begun = (states.voltage[at] == 0) & (states.mass[at] > 0)
        most = _NOTHING * np.abs(table.value[rows]).max(initial=0.0)
        if not begun.any() or np.abs(table.value[rows][begun]).max() > most:
            continue
        group = list(zip(*(getattr(states, name)[at].tolist()
                           for name in ("specimen", "mass", "run")), strict=True))
        origin = dict(zip([group[place] for place in np.flatnonzero(begun)], at[begun].tolist(),
                          strict=True))
        if set(group) != set(origin):
            continue
        kind, since = table.kind.copy(), table.since.copy()
        kind[rows], since[rows] = "range", [origin[each] for each in group]
        of = f"{sheet.heading('displacement')} of {sheet.file.name}"
        yield _Other(setup, replace(table, kind=kind, since=since), Confusion(
            of, "it were counted from the loaded plate without voltage", "do_zero"))


def _scaled(setup: Setup, table: ReadingTable, rows: Mask, column: str,
            factor: float) -> ReadingTable | None:
    """Multiply a column of some rows of a file by a factor; None where that is impossible."""
    if column in ("mass", "voltage"):
        states, of_file = table.states, np.zeros(len(table.states), bool)
        of_file[table.state[rows]] = True
        of_file[table.since[rows & (table.since >= 0)]] = True
        if column == "voltage" and of_file[states.in_time].any():
            return None
        factors = np.where(of_file, factor, 1.0)
        changed: dict[str, Any] = {column: factors * getattr(states, column)}
        return replace(table, states=replace(states, **changed))
    there = rows & (table.kind == column)
    values = np.where(there, factor, 1.0) * table.value
    gaps = np.array([specimen.gap for specimen in setup.specimens])[table.specimen]
    if not there.any() or (column in LENGTHS and np.any(np.abs(values) > gaps, where=there)):
        return None
    return table.with_values(values)


def _thicknesses(setup: Setup, table: ReadingTable, which: str | None = None
                 ) -> Iterator[_Other]:
    """Yield setups with the thickness of the mounted film read as that of the virgin film."""
    share = float(np.mean([specimen.membrane.area_prestretch for specimen in setup.specimens]))

    def virgin(film: Film) -> Film:
        return replace(film, thickness=film.thickness * film.area_prestretch)

    yield from _edited(setup, table, "membrane.thickness", "it were that of the stretched film",
                       lambda specimen: replace(specimen, membrane=virgin(specimen.membrane)),
                       which, log(share) * np.array([-1.0, 1.0]))


def _sizes(setup: Setup, table: ReadingTable, which: str | None = None) -> Iterator[_Other]:
    """Yield diameters read as radii and back, and area stretches read as stretches of an axis."""
    for part in ("plate", "frame"):
        for factor, taken in ((0.5, "it were its diameter"), (2.0, "it were half of it")):
            yield from _edited(setup, table, f"the radius of the {part}", taken,
                               _resized(part, factor), which)
    for power, taken in ((0.5, "it were the area stretch"), (2.0, "it were its root")):
        yield from _edited(setup, table, "membrane.prestretch", taken, _stretched(power),
                           which)


def _stretched(power: float) -> Callable[[Specimen], Specimen]:
    """Build a change that raises a specimen's stretches to a power."""

    def edit(specimen: Specimen) -> Specimen:
        film = specimen.membrane
        along_x, along_y = film.prestretch
        stretches = along_x**power, along_y**power
        return replace(specimen, membrane=replace(film, prestretch=stretches))

    return edit


def _edited(setup: Setup, table: ReadingTable, of: str, taken: str,
            edit: Callable[[Specimen], Specimen], which: str | None, shift: Array | None = None
            ) -> Iterator[_Other]:
    """Edit one specimen or all; yield the setup if it can be built."""
    try:
        confusion = Confusion(f"{of} of {which}" if which else of, taken)
        yield _Other(setup.with_specimens(edit, which), table, confusion, shift)
    except (InputError, TypeError):
        return


def _resized(part: str, factor: float) -> Callable[[Specimen], Specimen]:
    """Build a change that scales a specimen's plate or frame by a factor."""

    def larger(outline: Any) -> Any:
        if hasattr(outline, "radius"):
            return replace(outline, radius=factor * outline.radius)
        return replace(outline, semi_axes=tuple(factor * x for x in outline.semi_axes))

    def edit(specimen: Specimen) -> Specimen:
        if part == "frame":
            return replace(specimen, frame=larger(specimen.frame))
        plate = specimen.needed_plate()
        return replace(specimen, plate=replace(plate, outline=larger(plate.outline)))

    return edit
