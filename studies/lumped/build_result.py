"""Lumped models built from field models, as a result that saves and loads itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.files import read_json, remove, write_json
from tympan.studies.lumped.build import KINEMATICS, Built
from tympan.studies.lumped.model_file import LumpedModel, read_model, write_model

Array = NDArray[np.float64]
_DEFLECTIONS = ("field_mm", *(f"{kinematics}_mm" for kinematics in KINEMATICS))
_CAPACITANCES = ("field_pF", "corrected_pF")
_COLUMNS: tuple[Column, ...] = (
    Column.labels("specimen"), Column("mass", "g"), Column("voltage", "kV"), Column("fitted"),
    *(Column(name, required=False, absent="nan") for name in (*_DEFLECTIONS, *_CAPACITANCES)))


@dataclass(frozen=True, eq=False)
class ModelStatics:
    """A specimen's deflections at rest by both models, shape (masses, voltages) each.

    ``deflections`` [mm] and ``capacitances`` [pF] are by column of statics.csv; ``fitted`` says
    which loads the lumped model was fitted on.
    """

    specimen: str
    masses: Array
    voltages: Array
    fitted: NDArray[np.bool_]
    deflections: dict[str, Array]
    capacitances: dict[str, Array]

    def error(self, kinematics: str) -> Array:
        """A lumped model's deflection over the field model's, minus 1."""
        return np.asarray(self.deflections[f"{kinematics}_mm"] / self.deflections["field_mm"] - 1)


@dataclass(frozen=True, eq=False)
class BuildResult:
    """Models of several specimens, built at the same loads.

    ``numbers`` are those of ``lumped build --json``.
    """

    numbers: dict[str, Any]
    models: tuple[LumpedModel, ...]
    statics: tuple[ModelStatics, ...]

    @classmethod
    def of(cls, models: Sequence[Built]) -> BuildResult:
        """Of models built with the same settings."""
        chosen, statics = models[0].settings, []
        numbers = {"masses_kg": list(chosen.masses), "voltages_V": list(chosen.voltages),
                   "fitted_masses_kg": list(chosen.fit.masses),
                   "fitted_voltages_V": list(chosen.fit.voltages),
                   "built": [built.json() for built in models]}
        for built in models:
            deflections = [built.field_deflection, *built.deflection.values()]
            capacitances = [built.field_capacitance, built.capacitance["corrected"]]
            statics.append(ModelStatics(
                built.model.specimen.name, np.array(chosen.masses), np.array(chosen.voltages),
                chosen.fitted,
                dict(zip(_DEFLECTIONS, 1e3 * np.array(deflections), strict=True)),
                dict(zip(_CAPACITANCES, 1e12 * np.array(capacitances), strict=True))))
        return cls(numbers, tuple(built.model for built in models), tuple(statics))

    def json(self) -> dict[str, Any]:
        """The object of ``lumped build --json``."""
        return self.numbers

    def save(self, folder: Path) -> None:
        """Write build.json, statics.csv and for each specimen its model, NAME.lumped.toml.

        build.json comes last, so its presence means the rest is complete.
        """
        remove(folder, "build.json")
        columns: dict[str, list[Any]] = {column.name: [] for column in _COLUMNS}
        for statics in self.statics:
            mass, voltage = np.meshgrid(statics.masses, statics.voltages, indexing="ij")
            values = {"specimen": np.full(mass.shape, statics.specimen), "mass": mass,
                      "voltage": voltage, "fitted": statics.fitted,
                      **statics.deflections, **statics.capacitances}
            for name, column in columns.items():
                column.extend(values[name].ravel().tolist())
        write_sheet(folder / "statics.csv", _COLUMNS, columns)
        for model in self.models:
            write_model(folder / f"{model.specimen.name}.lumped.toml", model)
        write_json(folder / "build.json", self.json())

    @classmethod
    def load(cls, folder: Path) -> BuildResult:
        """What was saved.

        Raises
        ------
        InputError
            When a file is missing, damaged or of another kind.
        """
        numbers = read_json(folder / "build.json")
        if not isinstance(numbers, dict) or not numbers.get("built"):
            raise InputError("is not of tympan lumped build: run it again",
                             file=folder / "build.json")
        masses, voltages = np.array(numbers["masses_kg"]), np.array(numbers["voltages_V"])
        sheet = read_own_sheet(folder / "statics.csv", _COLUMNS)
        models, statics = [], []
        for built in numbers["built"]:
            name = built["specimen"]
            rows = sheet["specimen"] == name
            if rows.sum() != masses.size * voltages.size:
                raise InputError(f"must have a row of {name} for each load of build.json: run "
                                 "tympan lumped build again", file=folder / "statics.csv")
            fitted, *values = (sheet[column][rows].reshape(len(masses), -1)
                               for column in ("fitted", *_DEFLECTIONS, *_CAPACITANCES))
            columns = dict(zip((*_DEFLECTIONS, *_CAPACITANCES), values, strict=True))
            models.append(read_model(folder / f"{name}.lumped.toml"))
            statics.append(ModelStatics(name, masses, voltages, fitted == 1,
                                        {key: columns[key] for key in _DEFLECTIONS},
                                        {key: columns[key] for key in _CAPACITANCES}))
        return cls(numbers, tuple(models), tuple(statics))
