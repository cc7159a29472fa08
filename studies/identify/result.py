"""What an identification found, as a result that saves and loads itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.studies.columns import LabelColumn, NumberColumn, read_own_sheet, write_sheet
from tympan.studies.estimation.identifiability import Estimate, Identifiability
from tympan.studies.estimation.profile import Profile
from tympan.studies.files import from_json, read_json, remove, write_json
from tympan.studies.identify.dynamic_search import DynamicFit
from tympan.studies.identify.static_search import StaticFit

Array = NDArray[np.float64]
_FIGURES = "identify-figures.json"
_SHEETS = {"static": "identify-static.csv", "dynamic": "identify-responses.csv"}
_COLUMNS = {
    "static": (LabelColumn("specimen"), NumberColumn("mass", "g", "mass"),
               NumberColumn("voltage", "kV", "voltage"),
               NumberColumn("displacement", "mm", "length"),
               NumberColumn("fitted", "mm", "length")),
    "dynamic": (LabelColumn("specimen"), NumberColumn("mass", "g", "mass"), NumberColumn("run"),
                NumberColumn("since", "s", "time"), NumberColumn("displacement", "mm", "length"),
                NumberColumn("fitted", "mm", "length")),
}


@dataclass(frozen=True, eq=False)
class FittedReadings:
    """Displacements read and fitted [m] of one specimen under one mass [kg].

    ``at`` are their voltages [V], ascending, of readings at rest; of a response the times since its
    voltage first changed [s].
    """

    specimen: str
    mass: float
    at: Array
    read: Array
    fitted: Array


@dataclass(frozen=True, eq=False)
class Fitted:
    """One of both fits: what was read, and what it determines; profiles are of constants' values.

    ``radian`` is the time in which the fastest motion goes through one [s], of responses.
    """

    readings: tuple[FittedReadings, ...]
    determined: Identifiability
    radian: float | None = None


@dataclass(frozen=True, eq=False)
class IdentifyResult:
    """The numbers of ``lumped identify --json``, and each fit, by ``static`` and ``dynamic``."""

    numbers: dict[str, Any]
    fits: dict[str, Fitted]

    @classmethod
    def of(cls, numbers: dict[str, Any], static: StaticFit | None,
           dynamic: DynamicFit | None) -> IdentifyResult:
        """Of fits and what a command prints of them."""
        fits = {}
        if static is not None:
            fits["static"] = Fitted(tuple(_at_rest(static)), _in_values(static.judgement))
        if dynamic is not None:
            fits["dynamic"] = Fitted(tuple(_responses(dynamic)), _in_values(dynamic.judgement),
                                     dynamic.fast)
        return cls(numbers, fits)

    def json(self) -> dict[str, Any]:
        """The object of ``lumped identify --json``."""
        return self.numbers

    def save(self, folder: Path) -> None:
        """Write identify.json, and identify-….csv and .json with what its figures show.

        identify.json comes last, so its presence means the rest is complete.
        """
        remove(folder, "identify.json", _FIGURES, *_SHEETS.values())
        for name, fit in self.fits.items():
            place = _COLUMNS[name][2 if name == "static" else 3].name
            rows = [len(part.at) for part in fit.readings]
            write_sheet(folder / _SHEETS[name], _COLUMNS[name], {
                "specimen": np.repeat([part.specimen for part in fit.readings], rows),
                "mass": np.repeat([part.mass for part in fit.readings], rows),
                "run": np.repeat(np.arange(len(rows)), rows),
                place: np.concatenate([part.at for part in fit.readings]),
                "displacement": np.concatenate([part.read for part in fit.readings]),
                "fitted": np.concatenate([part.fitted for part in fit.readings])})
        write_json(folder / _FIGURES, {
            name: {"quantile": fit.determined.quantile, "radian_s": fit.radian,
                   "profiles": [None if profile is None else {
                       **vars(profile), "values": profile.values.tolist(),
                       "rise": profile.rise.tolist()} for profile in fit.determined.profiles]}
            for name, fit in self.fits.items()})
        write_json(folder / "identify.json", self.json())

    @classmethod
    def load(cls, folder: Path) -> IdentifyResult:
        """What was saved.

        Raises
        ------
        InputError
            When a file is missing, damaged or of another kind.
        """
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
            profiles = tuple(None if one is None else Profile(
                **{**one, "values": np.array(one["values"]), "rise": np.array(one["rise"])})
                for one in content["profiles"])
            determined = Identifiability(estimates, (), np.array(numbers[name]["correlations"]),
                                         profiles, content["quantile"], lambda _, value: value)
            sheet = read_own_sheet(folder / _SHEETS[name], _COLUMNS[name])
            fits[name] = Fitted(tuple(_parts(name, sheet)), determined, content["radian_s"])
        return cls(numbers, fits)


def _parts(name: str, sheet: dict[str, NDArray[Any]]) -> Iterator[FittedReadings]:
    """The rows of a sheet, by run, or by specimen and mass, in the order they stand there."""
    place = _COLUMNS[name][2 if name == "static" else 3].name
    keys = ("specimen", "mass") if name == "static" else ("run",)
    change = np.any([sheet[key][1:] != sheet[key][:-1] for key in keys], axis=0)
    for rows in np.split(np.arange(len(sheet["mass"])), np.flatnonzero(change) + 1):
        yield FittedReadings(str(sheet["specimen"][rows[0]]), float(sheet["mass"][rows[0]]),
                             sheet[place][rows], sheet["displacement"][rows],
                             sheet["fitted"][rows])


def _at_rest(fit: StaticFit) -> Iterator[FittedReadings]:
    readings, read = fit.problem.readings, fit.problem.read
    fitted = read + fit.problem.residual(fit.values, "deflection")[0]
    for mass in np.unique(readings.mass):
        for number, specimen in enumerate(readings.specimens):
            rows = np.flatnonzero((readings.which == number) & (readings.mass == mass))
            rows = rows[np.argsort(readings.voltage[rows])]
            if len(rows):
                yield FittedReadings(specimen.name, float(mass), readings.voltage[rows],
                                     read[rows], fitted[rows])


def _responses(fit: DynamicFit) -> Iterator[FittedReadings]:
    for record, (residual, _) in zip(fit.problem.records, fit.problem.parts(fit.z), strict=True):
        name = fit.problem.actuator(record, fit.z).specimen.name
        yield FittedReadings(name, record.mass, record.time - record.begins, record.displacement,
                             record.displacement + residual)


def _in_values(judgement: Identifiability) -> Identifiability:
    """With profiles of the constants' values, instead of what the search moved."""
    profiles = []
    for index, profile in enumerate(judgement.profiles):
        if profile is not None:
            def value(z: float | None, index: int = index) -> float | None:
                return None if z is None else judgement.values_of(index, z)

            values = np.array([judgement.values_of(index, z) for z in profile.values.tolist()])
            profile = replace(profile, values=values, low=value(profile.low),
                              high=value(profile.high))
        profiles.append(profile)
    return replace(judgement, profiles=tuple(profiles), values_of=lambda _, value: value)
