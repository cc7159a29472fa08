"""Capacitance against deflection, and deflection from capacitance, as stored results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key, Printed
from tympan.studies.case import SpecimenRecord, UnknownCount, WallTime, Warnings
from tympan.studies.columns import write_rows
from tympan.studies.driven import by_segment, drives_by_name
from tympan.studies.files import remove, write_text
from tympan.studies.force.result import ForceLimit
from tympan.studies.rows import rows_in
from tympan.studies.segments import Driven, share_words
from tympan.studies.sense.inverse import Inverse
from tympan.studies.sense.plate import PlateSense

#: Relative difference of voltages, and difference [V], within which they are the same: files have
#: 12 digits, and people write six.
_SAME = 1e-6


@dataclass(frozen=True, kw_only=True)
class SenseCurve(Driven):
    """The capacitance at one voltage; a number of each list for each deflection.

    The change of the sensed deflection is none where the capacitance does not rise.
    """

    capacitance_F: Annotated[tuple[float, ...], Key("capacitance of the film, ascending")]
    displacement_m: Annotated[tuple[float, ...], Key("deflections of the plate there, ascending")]
    force_N: Annotated[tuple[float, ...], Key("force that holds the plate there")]
    tense: Annotated[tuple[bool, ...], Key("whether no part of the film has lost tension")]
    per_capacitance_m_per_F: Annotated[tuple[float | None, ...], Key(
        "change of the sensed deflection by a capacitance read too large")]
    per_percent_prestretch_m: Annotated[tuple[float | None, ...], Key(
        "the same by a film that is prestretched 1 % more along both axes")]
    per_percent_permittivity_m: Annotated[tuple[float | None, ...], Key(
        "the same by a permittivity that is 1 % higher")]
    segment_capacitances_F: Annotated[Mapping[str, tuple[float, ...]], Key(
        "capacitance of each segment of the electrode there, by its name: charge over its own "
        "voltage; empty for an electrode in one piece"), Printed(columns="capacitance_F")] = (
            field(default_factory=dict))
    ended: Annotated[ForceLimit | None, Key(
        "where the film ends before the last deflection; none where it reaches that")]


@dataclass(frozen=True, kw_only=True)
class SensedState(Driven):
    """An equilibrium under a load at a voltage."""

    mass_kg: Annotated[float, Key("nominal load on the plate")]
    displacement_m: Annotated[float, Key("deflection")]
    capacitance_F: Annotated[float, Key("capacitance there")]
    sensed_m: Annotated[float | None, Key(
        "deflection that the polynomial tells from it; none beyond its range")]


@dataclass(frozen=True, kw_only=True)
class SenseResult(SpecimenRecord):
    """Capacitance against deflection of one specimen, and the inverse, SI."""

    ending = "-sense"
    writer = "tympan sense"
    indexed = ("voltage_V", "displacement_m")
    kinds = ("csv", "json", "c")
    drawn = ("png", "svg")

    curves: Annotated[tuple[SenseCurve, ...], Key("a curve for each voltage, ascending")]
    inverse: Annotated[Inverse, Key(
        "deflection from capacitance and voltage, in the first proportion of the segments' "
        "voltages")]
    other_inverses: Annotated[tuple[Inverse, ...], Key(
        "the same in other proportions; empty for one proportion")] = ()
    table_error_m: Annotated[float, Key(
        "largest error of the table between its rows, straight in the root of the capacitance over "
        "its first")]
    states: Annotated[tuple[SensedState, ...], Key("equilibria under the loads")] = ()
    plates: Annotated[tuple[PlateSense, ...], Key(
        "deflection and tilts from the capacitances of segments, at each voltage; empty without "
        "three segments")] = ()
    dofs: UnknownCount
    wall_s: WallTime
    warnings: Warnings = ()

    @property
    def inverses(self) -> tuple[Inverse, ...]:
        """Inverse of each proportion of the segments' voltages."""
        return self.inverse, *self.other_inverses

    def sensed(self, capacitance: Any, voltage: Any) -> Array:
        """Compute the deflection [m] from capacitances [F] and nominal voltages [V] by polynomial.

        It is NaN beyond the curves. Voltages of segments are given by name, one for each; so they
        must be where the result has several proportions.

        Raises
        ------
        InputError
            When the proportion of the voltages is none of those that were solved.
        """
        if by_segment(voltage):
            names, = drives_by_name(voltage, shares=False)
            top = max(names.values())
            return self._inverse(names, top).deflection(capacitance, top)
        if self.other_inverses:
            raise InputError('must name the segments, such as "A = 3 kV, B = 1 kV": this result '
                             "has several proportions of their voltages", key="voltage",
                             given=str(voltage))
        return self.inverse.deflection(capacitance, voltage)

    def _inverse(self, voltages: Mapping[str, float], top: float) -> Inverse:
        """Find the inverse of the proportion of voltages by name, the highest of which is given."""
        for inverse in self.inverses:
            shares = inverse.segment_shares
            if top == 0 or _near(voltages, {name: top * share for name, share in shares.items()}):
                return inverse
        known = "; ".join(share_words(each.segment_shares) for each in self.inverses)
        raise InputError(f"must be in a proportion that was solved: {known or 'one piece'}",
                         key="voltage", given=str(dict(voltages)))

    def sensed_plate(self, capacitances: Mapping[str, Any], voltage: Any) -> dict[str, Array]:
        """Sense the plate from the capacitances of segments [F] by their names, at a voltage [V].

        Voltages of segments are given by name, one for each, as for :meth:`sensed`. The result has
        ``deflection_m``, ``tilt_x_rad`` and ``tilt_y_rad``, which are NaN beyond the range.

        Raises
        ------
        InputError
            When the voltage is none of those that were solved, or a capacitance is missing.
        """
        names, = drives_by_name(voltage, shares=False) if by_segment(voltage) else ({},)
        top = max(names.values()) if names else float(voltage)
        solved = [each for each in self.plates if np.isclose(each.voltage_V, top) and (
            not names or _near(names, each.segment_voltages_V))]
        if not solved or (len(solved) > 1 and top > 0):
            known = "; ".join(each.drive for each in self.plates) or "none"
            raise InputError(f"must be one of the solved voltages: {known}", key="voltage",
                             given=str(voltage))
        plate = solved[0]
        for name in plate.segments:
            if name not in capacitances:
                raise InputError(f"must have the capacitance of {name}", key="capacitances",
                                 given=", ".join(capacitances))
        given = np.stack(np.broadcast_arrays(*(capacitances[name] for name in plate.segments)), -1)
        found = plate.sensed(given.reshape(-1, len(plate.segments))).reshape(*given.shape[:-1], 3)
        return dict(zip(("deflection_m", "tilt_x_rad", "tilt_y_rad"), np.moveaxis(found, -1, 0),
                        strict=True))

    @property
    def rows(self) -> dict[str, Array]:
        """The curves, a row for each deflection, with what the polynomial makes of each."""
        found = rows_in(self.curves, specimen=self.specimen)
        sensed = np.concatenate([self._inverse(
            curve.segment_voltages_V, curve.voltage_V).deflection(
                np.array(curve.capacitance_F), curve.voltage_V) for curve in self.curves])
        rows: dict[str, Array] = {}
        for name, values in found.items():
            rows[name] = values
            if name == "tense":
                rows["by_polynomial_m"] = sensed
        return rows

    def save(self, folder: Path) -> None:
        """Write ``NAME-sense.json``, ``.csv`` and ``.c``, the polynomial as C99."""
        remove(folder, *(f"{self.specimen}-sense.{kind}" for kind in self.kinds))
        super().save(folder)
        write_rows(folder / f"{self.specimen}-sense.csv", self.rows)
        write_text(folder / f"{self.specimen}-sense.c", "\n".join(
            each.c_source(self.specimen, number) for number, each in enumerate(self.inverses, 1)))


def _near(voltages: Mapping[str, float], others: Mapping[str, float]) -> bool:
    """Check whether voltages of segments by name are the same [V]; a missing name has none."""
    return all(np.isclose(voltages.get(name, 0.0), others.get(name, 0.0), rtol=_SAME, atol=_SAME)
               for name in {*voltages, *others})
