"""Result of an identification, which saves and loads itself."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tympan.base.errors import InputError
from tympan.studies.columns import Column, as_written, read_own_sheet, write_sheet
from tympan.studies.estimation.identifiability import Estimate, Identifiability
from tympan.studies.estimation.profile import Profile
from tympan.studies.files import from_json, read_json, remove, to_json, write_json
from tympan.studies.identify.dynamic import DynamicFit
from tympan.studies.identify.static import StaticFit

_FIGURES = "identify-figures.json"
_SHEETS = {"static": "identify-static.csv", "dynamic": "identify-responses.csv"}
_COLUMNS = {
    "static": (Column.labels("specimen"), Column("mass", "g"), Column("voltage", "kV"),
               Column("displacement", "mm"), Column("fitted", "mm")),
    "dynamic": (Column.labels("specimen"), Column("mass", "g"), Column("run"),
                Column("since", "s"), Column("displacement", "mm"), Column("fitted", "mm")),
}


@dataclass(frozen=True, eq=False)
class Fitted:
    """One of the two fits: its readings and what they determine, with profiles of the constants.

    ``readings`` have the columns of the fit's sheet in SI units. Readings at rest have the
    ``voltage``, ascending in each run; those of a response have the time ``since`` its voltage
    first changed. ``radian`` [s] is the time in which the fastest motion covers one radian, for
    responses.
    """

    readings: pd.DataFrame
    determined: Identifiability
    radian: float | None = None

    @property
    def runs(self) -> list[pd.DataFrame]:
        """The readings by run; at rest by specimen and mass."""
        keys = ["run"] if "run" in self.readings else ["specimen", "mass"]
        return [part for _, part in self.readings.groupby(keys, sort=False)]


@dataclass(frozen=True, eq=False)
class IdentifyResult:
    """The numbers of ``lumped identify --json``, and each fit, by ``static`` and ``dynamic``."""

    numbers: dict[str, Any]
    fits: dict[str, Fitted]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each constant of each fit."""
        return [{"fit": kind, **asdict(constant)} for kind, fit in self.fits.items()
                for constant in fit.determined.constants]

    @classmethod
    def of(cls, numbers: dict[str, Any], static: StaticFit | None,
           dynamic: DynamicFit | None) -> IdentifyResult:
        fits = {}
        if static is not None:
            fits["static"] = Fitted(_at_rest(static), static.judgement)
        if dynamic is not None:
            fits["dynamic"] = Fitted(_responses(dynamic), dynamic.judgement, dynamic.fast)
        return cls(numbers, fits)

    def json(self) -> dict[str, Any]:
        return self.numbers

    def save(self, folder: Path) -> None:
        """Write identify.json, and the data of its figures in identify-….csv and .json.

        identify.json is written last, so its presence means that the other files are complete.
        """
        remove(folder, "identify.json", "estimates.json", _FIGURES, *_SHEETS.values())
        for name, fit in self.fits.items():
            write_sheet(folder / _SHEETS[name], _COLUMNS[name], fit.readings)
        write_json(folder / _FIGURES, {
            name: {"quantile": fit.determined.quantile, "radian_s": fit.radian,
                   "profiles": to_json(fit.determined.profiles)}
            for name, fit in self.fits.items()})
        write_json(folder / "identify.json", self.json())

    def as_stored(self) -> IdentifyResult:
        """Round the result to the digits of its files."""
        return IdentifyResult(self.numbers, {
            name: replace(fit, readings=pd.DataFrame(as_written(_COLUMNS[name], fit.readings)))
            for name, fit in self.fits.items()})

    @classmethod
    def load(cls, folder: Path) -> IdentifyResult:
        """Load a saved result; a missing, damaged or wrong file is an InputError."""
        numbers = read_json(folder / "identify.json")
        figures = read_json(folder / _FIGURES)
        if not isinstance(numbers, dict) or not isinstance(figures, dict) \
                or not all(name in numbers and name in _SHEETS for name in figures):
            raise InputError("is not of tympan lumped identify: run it again",
                             file=folder / "identify.json")
        fits = {}
        for name, content in figures.items():
            estimates = from_json(tuple[Estimate, ...], numbers[name]["constants"],
                                  folder / "identify.json", f"{name}.constants")
            profiles = from_json(tuple[Profile | None, ...], content["profiles"],
                                 folder / _FIGURES, f"{name}.profiles")
            determined = Identifiability(estimates, (), np.array(numbers[name]["correlations"]),
                                         profiles, content["quantile"])
            sheet = read_own_sheet(folder / _SHEETS[name], _COLUMNS[name])
            fits[name] = Fitted(pd.DataFrame(sheet), determined, content["radian_s"])
        return cls(numbers, fits)


def _at_rest(fit: StaticFit) -> pd.DataFrame:
    problem = fit.problem
    names = np.array([specimen.name for specimen in problem.specimens])
    fitted = problem.read + problem.residual(fit.values, "deflection")[0]
    order = np.lexsort((problem.voltage, problem.which, problem.mass))
    return pd.DataFrame({"specimen": names[problem.which], "mass": problem.mass,
                         "voltage": problem.voltage, "displacement": problem.read,
                         "fitted": fitted}).iloc[order]


def _responses(fit: DynamicFit) -> pd.DataFrame:
    parts = zip(fit.problem.records, fit.problem.parts(fit.z), strict=True)
    return pd.concat([pd.DataFrame({
        "specimen": fit.problem.actuator(record, fit.z).specimen.name, "mass": record.mass,
        "run": number, "since": record.time - record.begins, "displacement": record.displacement,
        "fitted": record.displacement + residual})
        for number, (record, (residual, _)) in enumerate(parts)])
