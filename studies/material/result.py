"""What a fit of laws to coupon tests found, on disk and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.data.coupon import COLUMNS, MODES, Coupons, read_coupons
from tympan.studies.files import read_json, remove, write_json, write_text
from tympan.studies.material.fit import LawFit, best_offered, compare, material_lines, warnings

#: The columns of curves.csv: nominal stress of each law and half its 95 % band.
CURVES: tuple[Column, ...] = (
    Column.labels("law"),
    Column.labels("offered", ("yes", "no")),
    Column.labels("mode", tuple(MODES)),
    Column("stretch"),
    Column("nominal_stress", "kPa", required=False),
    Column("half_band", "kPa", required=False),
)
#: So many laws have curves, the best first.
_DRAWN = 6
_POINTS = 201


@dataclass(frozen=True, eq=False)
class MaterialFitResult:
    """The numbers of ``material fit --json``, the readings, and the laws' curves.

    ``curves`` has the columns of :data:`CURVES` in SI, shape (rows,), the best law first.
    """

    numbers: dict[str, Any]
    coupons: Coupons
    curves: Mapping[str, NDArray[Any]]

    def json(self) -> dict[str, Any]:
        """As a JSON object."""
        return self.numbers

    def save(self, folder: Path) -> None:
        """Write fit.json, coupon.csv, curves.csv and, if a law is offered, material.toml."""
        remove(folder, "fit.json", "fit.png", "fit.svg", "material.toml")
        readings = {"mode": self.coupons.mode, "stretch": self.coupons.stretch,
                    "nominal_stress": self.coupons.stress, "specimen": self.coupons.specimen,
                    "t": self.coupons.time, "run": self.coupons.run}
        write_sheet(folder / "coupon.csv", COLUMNS, readings)
        write_sheet(folder / "curves.csv", CURVES, self.curves)
        if self.numbers["material_toml"]:
            write_text(folder / "material.toml", self.numbers["material_toml"])
        write_json(folder / "fit.json", self.numbers)

    @classmethod
    def load(cls, folder: Path) -> MaterialFitResult:
        """What was saved."""
        return cls(read_json(folder / "fit.json"),
                   read_coupons(folder / "coupon.csv"),
                   read_own_sheet(folder / "curves.csv", CURVES))


def fit_coupons(file: Path, names: Sequence[str] | None = None,
                 noise: float | None = None) -> MaterialFitResult:
    """What laws fitted to a file of readings say; see :func:`~tympan.studies.material.fit.compare`.

    An :class:`InputError` names the file.
    """
    coupons = read_coupons(file)
    try:
        fits = compare(coupons, names, noise)
    except InputError as error:
        raise error.located(file=file) from None
    best = best_offered(fits)
    numbers = {
        "file": str(file),
        "readings": {mode: int((coupons.mode == mode).sum()) for mode in coupons.modes},
        "best": None if best is None else best.family.name,
        "material_toml": (None if best is None or best.material is None
                          else material_lines(best.material, best.range)),
        "noise_Pa": (best or fits[0]).noise.sigma,
        "fits": [fit.json() for fit in fits], "warnings": warnings(coupons, fits)}
    first = best or fits[0]
    drawn = [first, *(fit for fit in fits if fit is not first)][:_DRAWN]
    return MaterialFitResult(numbers, coupons, _curves(coupons, drawn))


def _curves(coupons: Coupons, fits: Sequence[LawFit]) -> dict[str, NDArray[Any]]:
    """Each law in each mode, up to the stretch it was tested to, or the other modes were."""
    parts: dict[str, list[NDArray[Any]]] = {column.name: [] for column in CURVES}
    for fit in fits:
        for mode in MODES:
            tested = coupons.stretch[coupons.mode == mode]
            reach = tested if len(tested) else coupons.stretch
            stretch = np.linspace(min(1.0, float(reach.min())), float(reach.max()), _POINTS)
            with np.errstate(all="ignore"):
                values = fit.predict(mode, stretch)
            # nan where the law does not reach.
            stress, half = (np.where(np.isfinite(value), value, np.nan) for value in values)
            labels = fit.family.name, "yes" if fit.offered else "no", mode
            columns = (*(np.full(_POINTS, label) for label in labels), stretch, stress, half)
            for name, column in zip(parts, columns, strict=True):
                parts[name].append(column)
    return {name: np.concatenate(columns) for name, columns in parts.items()}
