"""Subject of an explorer: a specimen, those of a dataset with its readings, or of a folder."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tympan.base.errors import InputError
from tympan.explore.view import FilmView
from tympan.fem.rig import Rig, load_actuator, mounted, mounted_together
from tympan.geometry.specimen import Specimen
from tympan.studies.columns import Sheet
from tympan.studies.data.dataset import read_dataset
from tympan.studies.shipped import load_named

_RIG = "rig.toml"


@dataclass(frozen=True, eq=False)
class Subject:
    """Specimens on a rig with their readings, if any.

    ``files`` are those of specimens that have one, by name, and ``rig_file`` is the rig's.
    """

    name: str
    specimens: tuple[Specimen, ...]
    rig: Rig
    static: Sheet | None = None
    files: tuple[str, ...] = ()
    rig_file: str = ""

    def masses(self, number: int) -> list[float]:
        """List the masses [kg] under which a specimen was measured, most frequent first."""
        if self.static is None:
            return []
        mass = self.static.mass[self.static.specimen == self.specimens[number].name]
        values, counts = np.unique(mass, return_counts=True)
        return [float(value) for value in values[np.argsort(-counts, kind="stable")]]

    def view(self, number: int, mass: float | None = None) -> FilmView:
        """Make the first view: without voltage, under a mass that suits the specimen."""
        masses = self.masses(number)
        mass = mass if mass is not None else masses[0] if masses else 20e-3
        return FilmView(self.specimens[number], self.rig, mass)


def read_subject(path: Path, rig: Path | None = None) -> Subject:
    """Read a specimen's file, a dataset's folder, or a folder of specimens, maybe with rig.toml.

    A ``rig`` that is given replaces the folder's.
    """
    if not path.is_dir():
        specimen, on = mounted(load_named(path), None if rig is None else Rig.read(rig))
        specimen.needed_plate()
        return Subject(specimen.name, (specimen,), on,
                       files=(str(path),), rig_file="" if rig is None else str(rig))
    subject = _dataset(path) if (path / "dataset.toml").exists() else _folder(path)
    return subject if rig is None else replace(subject, rig=Rig.read(rig), rig_file=str(rig))


def _dataset(folder: Path) -> Subject:
    dataset = read_dataset(folder)
    return Subject(dataset.name, dataset.specimens, dataset.rig, dataset.static)


def _folder(folder: Path) -> Subject:
    extended = folder / "extended"  # written by a diagnosis
    folder = extended if extended.is_dir() else folder
    files = sorted(file for file in folder.glob("*.toml") if file.name != _RIG)
    if not files:
        raise InputError("must hold dataset.toml or specimens (.toml)", file=folder)
    rig = folder / _RIG
    specimens, on = mounted_together(list(map(load_actuator, files)),
                                     Rig.read(rig) if rig.exists() else None)
    for specimen in specimens:
        specimen.needed_plate()
    return Subject(folder.resolve().name, specimens, on,
                   files=tuple(map(str, files)), rig_file=str(rig) if rig.exists() else "")
