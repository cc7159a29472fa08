"""Columns of electrodes in segments: voltage_A_kV, capacitance_A_pF for a segment named A."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tympan.base.arrays import Array
from tympan.base.toml_reader import POSITIVE, Rule
from tympan.geometry.specimen import Specimen
from tympan.studies.columns import Column, Sheet

#: Relative difference within which a voltage equals the highest one of its segments.
_SAME = 1e-6
#: Difference of a share from that of the file below which it is the same: that of a supply.
_IN_PROPORTION = 0.01
#: Digits of the shares in the name of a pattern of voltages.
_DIGITS = 6


def segment_names(specimens: Sequence[Specimen]) -> tuple[str, ...]:
    """List the names of all segments of some specimens, each once."""
    return tuple(dict.fromkeys(name for specimen in specimens for name in specimen.electrode.names))


def segment_columns(specimens: Sequence[Specimen], voltage: Rule, capacitances: bool
                    ) -> tuple[Column, ...]:
    """Make the columns of segments that a table may have."""
    names = segment_names(specimens)
    columns = [Column(f"voltage_{name}", "kV", voltage, required=False) for name in names]
    if capacitances:
        columns += [Column(f"capacitance_{name}", "pF", POSITIVE, required=False) for name in names]
    return tuple(columns)


def with_voltages(sheet: Sheet, specimens: Sequence[Specimen]) -> Sheet:
    """Give each row the highest voltage of its segments, and the name of its pattern (``drive``).

    Segments that are left blank have 0 V in a row with voltages of others, and in a table without
    voltages of whole films. Raise an
    :class:`InputError` for a voltage or capacitance of a segment that the row's specimen does not
    have, and for a voltage that is not the highest one of its segments.
    """
    names = segment_names(specimens)
    drive = np.full(len(sheet), "", dtype=object)
    voltage = sheet.values["voltage"].copy()
    own = {specimen.name: specimen.electrode.names for specimen in specimens}
    for name in names:
        for kind in ("voltage", "capacitance"):
            read = np.isfinite(sheet.values.get(f"{kind}_{name}", np.full(len(sheet), np.nan)))
            has = np.array([name in own[there] for there in sheet.specimen.tolist()])
            for row in np.flatnonzero(read & ~has):
                specimen = str(sheet.specimen[row])
                segments = ", ".join(own[specimen])
                raise sheet.error(int(row), f"{kind}_{name}", (
                    f"must be left blank: {specimen} has no segment {name}"
                    + (f"; its segments are {segments}" if segments else
                       "; its electrode is in one piece")))
    every = np.stack([sheet.values[f"voltage_{name}"] for name in names], 1) if names else (
        np.full((len(sheet), 1), np.nan))
    given = np.isfinite(every).any(1)
    highest = np.nan_to_num(every).max(1)
    for row in np.flatnonzero(given & np.isfinite(voltage)):
        if abs(voltage[row] - highest[row]) > _SAME * max(highest[row], 1.0):
            raise sheet.error(int(row), "voltage", "must be left blank, or be the highest voltage "
                              f"of the segments, {1e-3 * highest[row]:.6g} kV")
    if names and "voltage" not in sheet.sources and every.shape[1]:
        given[:] = True  # segments without a number have no voltage
    for row in np.flatnonzero(~given & np.isnan(voltage)):
        raise sheet.error(int(row), "voltage", "must be a number, or a segment must have a voltage")
    voltage[given] = highest[given]
    for row in np.flatnonzero(given & (highest > 0)):
        shares = np.nan_to_num(every[row]) / highest[row]
        drive[row] = ", ".join(f"{name} {round(share, _DIGITS):g}"
                               for name, share in zip(names, shares.tolist(), strict=True) if share)
    return replace(sheet, values={**sheet.values, "voltage": voltage, "drive": drive.astype(str)})


def require_proportion(sheet: Sheet, specimens: Sequence[Specimen]) -> None:
    """Raise an :class:`InputError` for voltages of segments in another proportion than the file's.

    A film in time is reduced for one proportion: its branches flow by all of its history.
    """
    shares, names = shares_of(sheet, specimens), segment_names(specimens)
    for specimen in specimens:
        electrode = specimen.electrode
        own = np.array([segment.share for segment in electrode.segments])
        for row in np.flatnonzero((sheet.specimen == specimen.name) & (sheet.voltage > 0)):
            given = shares[row, : len(own)]
            if np.isfinite(given).any() and np.abs(given - own).max() > _IN_PROPORTION:
                told = ", ".join(f"{name} {share:.4g}" for name, share in zip(
                    electrode.names, own.tolist(), strict=True))
                raise sheet.error(int(row), f"voltage_{names[0]}", (
                    f"must be in the proportion of the segments' shares in the file of "
                    f"{specimen.name}, {told}: in time tympan follows a film in one proportion. "
                    "Write the shares of this test into the specimen's file"))


def shares_of(sheet: Sheet, specimens: Sequence[Specimen]) -> Array:
    """Compute the voltages of segments over the row's, (rows, segments), by their numbers.

    Where a row gives none they are nan: those of the specimen's file hold.
    """
    most = max([1, *(len(specimen.electrode.segments) for specimen in specimens)])
    shares = np.full((len(sheet), most), np.nan)
    for specimen in specimens:
        rows = np.flatnonzero(sheet.specimen == specimen.name)
        names = specimen.electrode.names
        if not names or f"voltage_{names[0]}" not in sheet.values:
            continue
        every = np.stack([sheet.values[f"voltage_{name}"][rows] for name in names], 1)
        top = sheet.voltage[rows][:, None]
        driven = np.where(top > 0, np.nan_to_num(every) / np.maximum(top, 1e-300), 1.0)
        given = np.isfinite(every).any(1)
        shares[rows[given], : len(names)] = driven[given]
    return shares


def capacitances_of(sheet: Sheet, specimens: Sequence[Specimen]) -> list[Array]:
    """List the capacitances [F] of segments by their numbers, (rows,) each, nan if not read."""
    most = max(len(specimen.electrode.segments) for specimen in specimens)
    read = [np.full(len(sheet), np.nan) for _ in range(most)]
    for specimen in specimens:
        rows: NDArray[np.bool_] = sheet.specimen == specimen.name
        for number, name in enumerate(specimen.electrode.names):
            if f"capacitance_{name}" in sheet.values:
                read[number][rows] = sheet.values[f"capacitance_{name}"][rows]
    return read
