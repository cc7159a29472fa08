"""Result of a fit of laws to coupon tests, saved and loaded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.units import suffix_of
from tympan.studies.case import Case, Settings
from tympan.studies.columns import Column, as_written, read_own_sheet, write_sheet
from tympan.studies.data.coupon import COLUMNS, MODES, Coupons, read_coupons
from tympan.studies.files import read_json, remove, write_json, write_text
from tympan.studies.material.branches import BranchFit, branch_lines, compare_in_time
from tympan.studies.material.film import film_deflection
from tympan.studies.material.fit import (
    NOTES,
    LawFit,
    best_offered,
    compare,
    material_lines,
    warnings,
)
from tympan.studies.material.time_in_runs import time_in_runs
from tympan.tables.layouts import Layout

#: Columns of curves.csv: nominal stress of each law and half its 95 % band.
CURVES: tuple[Column, ...] = (
    Column.labels("law"),
    Column.labels("offered", ("yes", "no")),
    Column.labels("mode", tuple(MODES)),
    Column("stretch"),
    Column("nominal_stress", "kPa", required=False),
    Column("half_band", "kPa", required=False),
)
#: Columns of histories.csv: stress of the best law with branches at every reading in time, and half
#: its 95 % band.
HISTORIES: tuple[Column, ...] = (
    *COLUMNS,
    Column("fitted_stress", "kPa"),
    Column("half_band", "kPa"),
)
#: Number of laws with curves, the best first.
_DRAWN = 6
_POINTS = 201


@dataclass(frozen=True, eq=False)
class MaterialFitResult:
    """The numbers of ``material fit --json``, the readings, and the laws' curves.

    ``curves`` has the columns of :data:`CURVES` in SI, shape (rows,), the best law first; fits with
    branches give those at rest, and ``histories`` with the columns of :data:`HISTORIES`.
    """

    pictures: ClassVar[tuple[str, ...]] = ("fit.png", "fit.svg")  #: names of its pictures

    numbers: dict[str, Any]
    coupons: Coupons
    curves: Mapping[str, Array]
    histories: Mapping[str, Array] | None = None

    @property
    def rows(self) -> dict[str, Array]:
        """The laws' curves."""
        units = {"nominal_stress": "nominal_stress_Pa", "half_band": "half_band_Pa"}
        return {units.get(name, name): values for name, values in self.curves.items()}

    @property
    def fits(self) -> list[dict[str, Any]]:
        """All laws, the best first: names, constants with limits, misfits and notes."""
        return list(self.numbers["fits"])

    @property
    def best(self) -> dict[str, Any] | None:
        """The law to take, as in :attr:`fits`; None where none is offered."""
        return next((fit for fit in self.fits if fit["name"] == self.numbers["best"]), None)

    @property
    def key_numbers(self) -> dict[str, Any]:
        """The best law that is offered, else the first one: its misfit and its constants."""
        fit = self.best or self.fits[0]
        found = {"law": fit["name"], "offered": fit["offered"], "rmse_Pa": fit["rmse_Pa"]}
        found |= {name + suffix_of(constant["unit"]): constant["value"]
                  for name, constant in fit["constants"].items()}
        for number, branch in enumerate(fit.get("branches", ()), 1):
            found |= {f"branch_{number}_modulus_Pa": branch["modulus"]["value"],
                      f"branch_{number}_time_s": branch["time"]["value"]}
        return found

    def json(self) -> dict[str, Any]:
        """Write the result as a JSON object."""
        return self.numbers

    def save(self, folder: Path) -> None:
        """Write fit.json, coupon.csv, curves.csv and, if a law is offered, material.toml.

        Tests in time have histories.csv as well.
        """
        remove(folder, "fit.json", "material.toml", "histories.csv")
        write_sheet(folder / "coupon.csv", COLUMNS, self.coupons.columns)
        write_sheet(folder / "curves.csv", CURVES, self.curves)
        if self.histories is not None:
            write_sheet(folder / "histories.csv", HISTORIES, self.histories)
        if self.numbers["material_toml"]:
            write_text(folder / "material.toml", self.numbers["material_toml"])
        write_json(folder / "fit.json", self.numbers)

    def as_stored(self) -> MaterialFitResult:
        """Round to the digits of its files."""
        histories = None if self.histories is None else as_written(HISTORIES, self.histories)
        return replace(self, curves=as_written(CURVES, self.curves), histories=histories)

    @classmethod
    def load(cls, folder: Path) -> MaterialFitResult:
        """Load a saved fit."""
        histories = folder / "histories.csv"
        return cls(read_json(folder / "fit.json"),
                   read_coupons(folder / "coupon.csv"),
                   read_own_sheet(folder / "curves.csv", CURVES),
                   read_own_sheet(histories, HISTORIES) if histories.exists() else None)


def fit_coupons(files: Path | Sequence[Path], names: Sequence[str] | None = None,
                noise: float | None = None, branches: int | None = None, film: Case | None = None,
                settings: Settings = Settings(), layout: Layout = Layout()) -> MaterialFitResult:
    """Fit laws to the readings of one file or several.

    Where the runs separate time from stretch (``numbers["time"]``), laws are fitted with
    ``branches``, or as many as held-out runs choose: see
    :func:`~tympan.studies.material.branches.compare_in_time`. Otherwise, or with 0 branches, laws
    without: :func:`~tympan.studies.material.fit.compare`. With a ``film`` its deflection by the
    fitted laws is added, with limits: see :func:`~tympan.studies.material.film.film_deflection`. An
    :class:`InputError` names the file. ``layout`` says what the files' headings leave open.
    """
    if noise is not None and not 1e-6 <= noise <= 1e9:
        raise InputError("must be from 1e-6 Pa to 1 GPa", key="--noise", given=f"{noise:g} Pa")
    names = None if not names or "all" in names else names
    files = [files] if isinstance(files, Path) else [*files]
    coupons, said = _without_voltage(read_coupons(*files, layout=layout))
    try:
        thin = coupons.thinned() if coupons.in_time else coupons
        time = time_in_runs(thin) if branches != 0 and coupons.in_time else None
        if branches and time is not None and not time.separable:
            raise InputError(f"must be 0: {time.reason}; needed is {' or '.join(time.needed)}",
                             key="--branches", given=branches)
        if time is not None and (branches or time.shown):
            fits: Sequence[LawFit | BranchFit]
            fits = branched = compare_in_time(thin, names, noise, branches)
            result, used = _fitted_in_time(thin, branched), thin
            if thin is not coupons:
                result.numbers["warnings"].append(NOTES["thinned"].format(
                    every=len(coupons), kept=len(thin)))
        elif branches:
            raise InputError("needs the column t_s with several times in a run", key="--branches",
                             given=branches)
        else:
            fits = elastic = compare(coupons, names, noise)
            result, used = _fitted(coupons, elastic, at_rest=time is not None), coupons
    except InputError as error:
        raise error.located(file=files[0]) from None
    deflection = None if film is None else film_deflection(film, settings, used, fits, noise)
    result.numbers["film"] = None if deflection is None else deflection.json()
    result.numbers["time"] = None if time is None else time.json()
    if time is not None and time.reason:
        result.numbers["warnings"].insert(0, time.reason)
    result.numbers["file"] = ", ".join(map(str, files))
    result.numbers["warnings"] += said
    return result


def _without_voltage(coupons: Coupons) -> tuple[Coupons, list[str]]:
    """Select readings without voltage, with remarks on those left out or at other temperatures."""
    plain, said = coupons.volts == 0, [*coupons.remarks]
    if not plain.all():
        said.append(NOTES["charged"].format(count=int((~plain).sum())))
    kept = coupons if plain.all() else coupons[plain]
    if len(kept) and np.ptp(kept.degrees) > 0:
        said.append(NOTES["warm"].format(low=kept.degrees.min(), high=kept.degrees.max()))
    return kept, said


def _fitted_in_time(coupons: Coupons, fits: Sequence[BranchFit]) -> MaterialFitResult:
    laws = [fit.law for fit in fits]
    best = next((fit for fit in fits if fit.law.offered), fits[0])
    result = _fitted(coupons, laws, at_rest=True)
    text = result.numbers["material_toml"]
    result.numbers.update({"material_toml": text and text + branch_lines(best.branches),
                           "fits": [fit.json() for fit in fits]})
    timed = np.isfinite(coupons.time)
    histories = coupons[timed].columns | {"fitted_stress": best.stress[timed],
                                          "half_band": best.half[timed]}
    return replace(result, histories=histories)


def _fitted(coupons: Coupons, fits: Sequence[LawFit], at_rest: bool = False) -> MaterialFitResult:
    best = best_offered(fits)
    numbers = {
        "file": "",
        "readings": {mode: int((coupons.mode == mode).sum()) for mode in coupons.modes},
        "best": None if best is None else best.family.name,
        "material_toml": (None if best is None or best.material is None
                          else material_lines(best.material, best.range)),
        "noise_Pa": (best or fits[0]).noise.size,
        "fits": [fit.json() for fit in fits], "warnings": warnings(coupons, fits, at_rest)}
    first = best or fits[0]
    drawn = [first, *(fit for fit in fits if fit is not first)][:_DRAWN]
    return MaterialFitResult(numbers, coupons, _curves(coupons, drawn))


def _curves(coupons: Coupons, fits: Sequence[LawFit]) -> dict[str, Array]:
    """Evaluate each law in each mode, up to the stretch of its tests or of the other modes."""
    parts: dict[str, list[Array]] = {column.name: [] for column in CURVES}
    for fit in fits:
        for mode in MODES:
            tested = coupons.stretch[coupons.mode == mode]
            reach = tested if len(tested) else coupons.stretch
            stretch = np.linspace(min(1.0, float(reach.min())), float(reach.max()), _POINTS)
            with np.errstate(all="ignore"):
                values = fit.predict(mode, stretch)
            # A law is nan beyond its reach.
            stress, half = (np.where(np.isfinite(value), value, np.nan) for value in values)
            labels = fit.family.name, "yes" if fit.offered else "no", mode
            columns = (*(np.full(_POINTS, label) for label in labels), stretch, stress, half)
            for name, column in zip(parts, columns, strict=True):
                parts[name].append(column)
    return {name: np.concatenate(columns) for name, columns in parts.items()}
