"""Whether a limit is as certain as it says: against finer meshes, swapped axes and a mirror image.

    python -m benchmarks.trials.mesh_spreads [--count 100] [--seed 1] [--workers 1]
    [--keep mesh-spreads.jsonl] [-o docs/robustness.md]

A limit's `spread` is how far its voltage may be off. The truth is the limit on a mesh whose
elements are `FINER` times smaller; the film with its axes swapped, and its mirror image, are the
same film on other meshes. With --keep, films that were judged before are not judged again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator, default_rng

from benchmarks.trials.robustness import Judge, judged_once, run_study
from tympan.base.errors import InputError
from tympan.fem.film.laws import NeoHooke, Yeoh
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle, Ellipse, Outline
from tympan.geometry.specimen import Electrode, Film, Plate, Specimen
from tympan.studies.case import Case, Settings
from tympan.studies.limits import limits

#: How many times smaller the elements of the truth are.
FINER = 2.0

#: Share of limits whose spread has to hold the truth.
HELD = 0.95

#: The limits of a film that are compared.
KINDS: tuple[str, ...] = ("tension", "instability", "pull_in")

_MESH = MeshSettings()


class Compared(NamedTuple):
    """A limit on a mesh against another: relative difference, and the spread that it states."""

    kind: str
    way: str
    error: float
    spread: float


@dataclass(frozen=True)
class Drawn:
    """A film of the design under a mass."""

    number: int
    case: Case


@dataclass(frozen=True)
class Record:
    """What became of a film: its limits against those of other meshes."""

    number: int
    status: str
    words: str = ""
    seconds: float = 0.0
    case: str = ""
    compared: tuple[Compared, ...] = ()

    @property
    def wrong(self) -> str:
        """Limits whose spread is too small; empty where none is."""
        return "; ".join(f"{limit.kind}, {limit.way}: {limit.error:.1e}, stated {limit.spread:.1e}"
                         for limit in self.compared if limit.error > limit.spread)


def design(count: int, seed: int = 1) -> Iterator[Drawn]:
    """Films, each with a generator of its own; a third round, equal and centred."""
    for number in range(count):
        random = default_rng([seed, number])
        while True:
            try:
                case = _case(number, random)
            except InputError:
                continue
            break
        yield Drawn(number, case)


def _case(number: int, random: Generator) -> Case:
    size = random.uniform(25e-3, 60e-3)
    aspect = np.sqrt(random.uniform(1, 2)) if random.random() < 0.6 else 1.0
    frame: Outline = Circle(size) if aspect == 1 else Ellipse((size * aspect, size / aspect))
    plate = Circle(min(frame.semi_axes) * random.uniform(0.15, 0.4))
    room = min(frame.semi_axes) - plate.radius
    turn, share = random.uniform(0, 2 * np.pi), random.uniform(0, 0.5) * (random.random() < 0.6)
    first, second = random.uniform(1.2, 3.2, 2)
    stretch = (first, second if random.random() < 0.6 else first)
    law = NeoHooke(20e3) if random.random() < 0.6 else Yeoh(15e3, 100.0, 1.0)
    film = Film(random.uniform(0.2e-3, 1e-3), (float(stretch[0]), float(stretch[1])), law, 4.0)
    specimen = Specimen(f"spread {number}", frame, Plate(plate, (
        float(share * room * np.cos(turn)), float(share * room * np.sin(turn)))), film)
    if random.random() < 0.3:
        specimen = replace(specimen, electrode=Electrode(0.2 * specimen.gap, 0.1 * specimen.gap))
    return Case(specimen, mass=random.uniform(1e-3, 20e-3))


def swapped(specimen: Specimen) -> Specimen:
    """The film with x and y swapped."""
    plate, film, frame = specimen.needed_plate(), specimen.membrane, specimen.frame
    turned = frame if isinstance(frame, Circle) else Ellipse(frame.semi_axes[::-1])
    return replace(specimen, frame=turned, plate=replace(plate, offset=plate.offset[::-1]),
                   membrane=replace(film, prestretch=film.prestretch[::-1]))


def mirrored(specimen: Specimen) -> Specimen:
    """The film's mirror image, right becoming left."""
    plate = specimen.needed_plate()
    x, y = plate.offset
    return replace(specimen, plate=replace(plate, offset=(-x, y)))


def judged(drawn: Drawn, mesh: MeshSettings = _MESH, finer: float = FINER) -> Record:
    """The limits of a film on a mesh, and of the same film on others."""
    case, settings = drawn.case, Settings(mesh)
    here = limits(case, settings, beyond=True)
    others = {"finer": (case, Settings(mesh.refined(finer))),
              "swapped": (replace(case, specimen=swapped(case.specimen)), settings),
              "mirrored": (replace(case, specimen=mirrored(case.specimen)), settings)}
    compared: list[Compared] = []
    for way, (other, its_settings) in others.items():
        there = limits(other, its_settings, beyond=True)
        for kind in KINDS:
            limit, two = getattr(here, kind), getattr(there, kind)
            if limit is not None and two is not None and two.voltage_V:
                stated = limit.spread + (0.0 if way == "finer" else two.spread)
                error = abs(limit.voltage_V / two.voltage_V - 1)
                compared.append(Compared(kind, way, error, stated))
    return Record(drawn.number, "compared", case=str(case.specimen), compared=tuple(compared))


def _failed(drawn: Drawn, status: str, words: str) -> Record:
    return Record(drawn.number, status, words)


def study(count: int, seed: int, workers: int, kept: Path | None, mesh: MeshSettings = _MESH
          ) -> list[Record]:
    """All films judged, those in a file of records not again."""
    judge = Judge(partial(judged, mesh=mesh), _failed)
    return judged_once(judge, design(count, seed), workers, kept, _read)


def _read(line: dict[str, Any]) -> Record:
    return Record(**line | {"compared": tuple(Compared(*limit) for limit in line["compared"])})


def held_share(records: Sequence[Record], kind: str = "", way: str = "") -> float:
    """Share of the comparisons of a kind and a way whose spread holds; 1 where there are none."""
    holds = [limit.error <= limit.spread for record in records for limit in record.compared
             if limit.kind.startswith(kind) and limit.way.startswith(way)]
    return float(np.mean(holds)) if holds else 1.0


def table(records: Sequence[Record]) -> str:
    """The study in lines."""
    lines = [f"{len(records)} films, {sum(record.status != 'compared' for record in records)} of "
             "them raised or hung", "", f"{'limit, against':24}count  held  largest error / spread"]
    for kind in KINDS:
        for way in ("finer", "swapped", "mirrored"):
            group = [limit for record in records for limit in record.compared
                     if (limit.kind, limit.way) == (kind, way)]
            if group:
                worst = max(limit.error / max(limit.spread, 1e-12) for limit in group)
                lines.append(f"{kind + ', ' + way:24}{len(group):5d} "
                             f"{held_share(records, kind, way):5.0%}  {worst:.2f}")
    lines += ["", f"held in all: {held_share(records):.1%}", "", "too small"]
    lines += [f"  #{record.number}: {record.wrong}" for record in records if record.wrong] \
        or ["  none"]
    return "\n".join(lines)


PAGE = """## Stated errors of limits

How far may a limit be off because of the mesh? The program states this as the limit's `spread`.
Here the default mesh is compared with elements half as large, and with the same film with its axes
swapped and mirrored. Frames are round and elliptic, plates off centre, prestretches unequal from
1.2 to 3.2.
"""


def main() -> None:
    """Run the study and print its table."""
    run_study("Stated errors of limits against finer meshes.", 100, study, table, _MESH, PAGE)


if __name__ == "__main__":
    main()
