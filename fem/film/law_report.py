"""Report on a law alone: true stress against stretch, and the first stretches where it fails."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import read
from tympan.base.toml_reader import Table
from tympan.fem.film.admissibility import STRETCH_RANGE, ellipticity_margin, inadmissible_stretch
from tympan.fem.film.library import EXAMINED, MATERIALS, READERS, examine_material
from tympan.geometry.specimen import Film, Material, Specimen

StretchPair = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Examination:
    """Behaviour of a law over :data:`tympan.fem.film.admissibility.STRETCH_RANGE`.

    True stress [Pa] at ``stretch``: equibiaxial, and along a strip whose other stretch is
    ``mounted``; nan where the law cannot be stretched so far. ``hill`` and ``ellipticity`` are the
    failing stretches nearest to ``mounted``, each None where there are none; ``peaks`` the first
    stretches from which the two stresses fall.
    """

    material: Material
    mounted: float
    stretch: Array
    equibiaxial: Array
    strip: Array
    hill: StretchPair | None
    ellipticity: StretchPair | None
    peaks: tuple[float | None, float | None]

    def json(self) -> dict[str, Any]:
        """Write the report as a JSON object; stresses that do not exist are None."""
        def numbers(values: Array) -> list[float | None]:
            return [float(value) if np.isfinite(value) else None for value in values]

        return {"law": self.material.law, "material": str(self.material),
                "held_stretch": self.mounted,
                "stretch": numbers(self.stretch),
                "equibiaxial_true_stress_Pa": numbers(self.equibiaxial),
                "strip_true_stress_Pa": numbers(self.strip),
                "hill_fails_at": self.hill and list(self.hill),
                "ellipticity_fails_at": self.ellipticity and list(self.ellipticity),
                "equibiaxial_stress_falls_from": self.peaks[0],
                "strip_stress_falls_from": self.peaks[1]}

    def __str__(self) -> str:
        rows = [f"{self.material}",
                f"true stress in kPa; strip: the other stretch held at {self.mounted:.4g}",
                f"{'stretch':>8} {'equibiaxial':>12} {'strip':>12}"]
        rows += [f"{stretch:8.3f} {both / 1e3:12.5g} {strip / 1e3:12.5g}"
                 for stretch, both, strip in zip(self.stretch, self.equibiaxial, self.strip,
                                                 strict=True)]
        rows += [_failure("Hill's inequality", self.hill, self.mounted),
                 _failure("strong ellipticity within the film", self.ellipticity, self.mounted)]
        rows += [f"{name} stress falls from stretch {peak:.3f} on" for name, peak in
                 zip(("equibiaxial", "strip"), self.peaks, strict=True) if peak is not None]
        return "\n".join(rows)


def subject(name: str, mounted: float | None = None) -> tuple[Material, float]:
    """Find a material to examine and its mounted stretch, by name or from a specimen file."""
    if mounted is not None and not 0.2 <= mounted <= 10:
        raise InputError("must be a stretch between 0.2 and 10", key="--held", given=mounted)
    laws = {key: entry.material for key, entry in MATERIALS.items()} | dict(EXAMINED)
    if name in laws:
        material = laws[name]
        return material, mounted or float(np.real(getattr(material, "reference", 1.0)))
    if not Path(name).suffix:
        raise InputError(f"must be a specimen file or one of {', '.join(laws)}", key="material",
                         given=name)
    readers = {**READERS, (Film, "material"): examine_material}
    film = read(Specimen, Table.read(name, "specimen"), readers).membrane
    return film.material, mounted or film.area_prestretch**0.5


def examine(material: Material, mounted: float = 1.0) -> Examination:
    """Examine a law about an equibiaxial stretch.

    Examples
    --------
    >>> from tympan.fem.film.laws import Ogden
    >>> examine(Ogden((20e3, -500.0), (2.0, 4.0))).peaks[0]
    4.47
    """
    fine = np.round(np.arange(STRETCH_RANGE[0], STRETCH_RANGE[1] + 0.005, 0.01), 2)
    with np.errstate(all="ignore"):
        stresses = (np.real(fine * material.derivatives(fine, other)[1])
                    for other in (fine, np.full_like(fine, mounted)))
        both, strip = (np.where(np.isfinite(stress), stress, np.nan).astype(float)
                       for stress in stresses)
    coarse = np.isclose(fine * 4 % 1, 0)
    return Examination(
        material, mounted, fine[coarse], both[coarse], strip[coarse],
        inadmissible_stretch(material, nearest=mounted),
        inadmissible_stretch(material, margin=ellipticity_margin, nearest=mounted),
        (_peak(fine, both, mounted), _peak(fine, strip, mounted)))


def _peak(stretch: Array, stress: Array, mounted: float) -> float | None:
    """Find the first stretch from which a stress falls, from the mounted stretch on if it can."""
    falling = np.flatnonzero(np.diff(stress) < 0)
    onward = falling[stretch[falling] >= mounted - 1e-9]
    first = onward if len(onward) else falling
    return float(stretch[first[0]]) if len(first) else None


def _failure(what: str, stretches: StretchPair | None, mounted: float) -> str:
    low, high = STRETCH_RANGE
    if stretches is None:
        return f"{what} holds for all stretches from {low} to {high}"
    return (f"{what} fails from {low} to {high}, nearest to the mounted stretch {mounted:.4g} at "
            f"({stretches[0]:.3g}, {stretches[1]:.3g})")
