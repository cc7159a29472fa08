"""Compare tympan with an independent membrane code on films with electrodes in sectors.

    python -m benchmarks.sectors --peer-python PYTHON [--only TEXT] [-o FILE]

PYTHON is one that has NGSolve. The films are those of `peers/driven_sectors.py`. Their rigid plate
may shift and turn in all ways. Both codes solve each film on two meshes. A difference is relative
to the length of a vector, such as that of both tilts. Two columns show by how much the finer mesh
changes the value of each code. The run fails if a difference is larger than allowed.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from math import radians
from pathlib import Path

import numpy as np

from benchmarks.peers.driven_sectors import EPSILON_0, FILMS, SectorFilm, SectorRow
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.film.laws import Ogden
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import PlateMotion, State, turned
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Electrode, Film, Plate, Segment, Specimen
from tympan.studies.case import Settings, build_model

PEER = Path(__file__).parent / "peers/ngsolve_quarter.py"

#: A coarse mesh and a fine one: levels of the peer, factors on tympan's default mesh.
LEVELS, FACTORS = (1, 2), (1.0, 2.0)


@dataclass(frozen=True)
class Vector:
    """Values of a row that are compared together: names, unit, and the difference allowed."""

    names: tuple[str, ...]
    unit: str
    per_unit: float
    allowed: float
    of: Callable[[SectorRow], Sequence[float]]

    def array(self, row: SectorRow) -> np.ndarray:
        """Values in the unit."""
        values: np.ndarray = np.asarray(self.of(row), dtype=float)
        return values * self.per_unit

    def labels(self, row: SectorRow) -> list[str]:
        """Name of each value; several capacitances are numbered."""
        count = len(self.of(row))
        return [*self.names] if len(self.names) == count else [
            f"{self.names[0]} {number}" for number in range(1, count + 1)]

    def differences(self, row: SectorRow, reference: SectorRow) -> np.ndarray:
        """Differences of all values, relative to the length of the reference."""
        exact = self.array(reference)
        return np.abs(self.array(row) - exact) / np.linalg.norm(exact)


VECTORS = (
    Vector(("deflection",), "mm", 1e3, 1e-4, lambda row: [row.deflection_m]),
    Vector(("tilt rx", "tilt ry"), "mrad", 1e3, 1e-3, lambda row: [row.rx, row.ry]),
    Vector(("shift x", "shift y"), "mm", 1e3, 1e-4, lambda row: [row.x_m, row.y_m]),
    Vector(("capacitance",), "nF", 1e9, 1e-4, lambda row: row.capacitances_F),
    Vector(("force x, held", "force y, held", "force z, held"), "N", 1.0, 1e-4,
           lambda row: row.forces_N),
    Vector(("moment x, held", "moment y, held"), "mN m", 1e3, 1e-3, lambda row: row.moments_Nm))


def specimen(film: SectorFilm) -> Specimen:
    """The film with its sectors as tympan's specimen; the shares are of the highest voltage."""
    moduli, exponents = zip(*film.terms, strict=True)
    membrane = Film(film.thickness, (film.prestretch,) * 2, Ogden(moduli, exponents),
                    film.permittivity / EPSILON_0)
    top = highest(film)
    segments = tuple(
        Segment(name=f"S{number}", sector=(radians(sector.start), radians(sector.end)),
                share=sector.voltage / top)
        for number, sector in enumerate(film.sectors))
    return Specimen("sectors", Circle(film.outer), Plate(Circle(film.inner)), membrane,
                    Electrode(segments=segments))


def highest(film: SectorFilm) -> float:
    """The highest voltage of a film's sectors [V], that of the film."""
    return max(sector.voltage for sector in film.sectors)


def own_row(film: SectorFilm, factor: float) -> SectorRow:
    """Solve the film by tympan, its default mesh refined."""
    began, voltage = time.perf_counter(), highest(film)
    loaded = build_model(specimen(film), Settings(MeshSettings().refined(factor)))
    outcome = equilibrium(loaded, film.weight, voltage)
    upright = replace(loaded, loading=Loading(guide="vertical"))
    drawn = held(upright, film.drawn, voltage)
    for each in (outcome, drawn):
        if each.status != "equilibrium":
            raise RuntimeError(f"{film.name}: {each.status}, {each.advice}")
    plate = outcome.state.plate
    rx, ry, rz = turned(plate, PlateMotion.rest()).tolist()
    x, y, z = plate.translation.tolist()
    on_edge = upright.nodal_forces(drawn.state)[upright.discretisation.plate_nodes]
    force_x, force_y, force_z, moment_x, moment_y, _ = (
        drawn.state.plate.gathered(upright.arms, on_edge).tolist())
    mesh = loaded.discretisation
    return SectorRow(
        package=f"tympan {version('tympan')}", film=film.name,
        mesh=f"P{mesh.mesh.order}, {len(mesh.connectivity)} triangles", unknowns=loaded.unknowns,
        deflection_m=z, rx=rx, ry=ry, rz=rz, x_m=x, y_m=y,
        capacitances_F=tuple(capacitances(loaded, outcome.state)),
        tension_Pa=loaded.least_stress(outcome.state) or 0.0,
        forces_N=(force_x, force_y, force_z), moments_Nm=(moment_x, moment_y),
        seconds=time.perf_counter() - began)


def capacitances(model: Model, state: State) -> Iterator[float]:
    """Yield the capacitance of each segment [F], with only that one charged."""
    electrode = model.specimen.electrode
    for number in range(len(electrode.segments)):
        alone = [float(place == number) for place in range(len(electrode.segments))]
        charged = replace(model.specimen, electrode=electrode.with_shares(alone))
        yield float(replace(model, specimen=charged).capacitance(state))


def peer_rows(python: str, film: SectorFilm) -> list[SectorRow]:
    """Rows of the peer script for a film, from its own Python."""
    command = [python, str(PEER), "--only", film.name, "--levels", *map(str, LEVELS)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit((done.stderr.strip().splitlines() or ["the peer failed"])[-1])
    return [SectorRow(**json.loads(line)) for line in done.stdout.splitlines()]


def table(peer: list[SectorRow], own: list[SectorRow]) -> Iterator[str]:
    """Lines of a film's table: both codes on their finer meshes, and the changes by refinement."""
    for row in (peer[-1], own[-1]):
        yield (f"  {row.package}: {row.mesh}, {row.unknowns:,} unknowns, {row.seconds:.0f} s, "
               f"least tension {row.tension_Pa / 1e3:.1f} kPa")
    yield (f"  {'':22}{'peer':>14}{'tympan':>14}{'difference':>12}{'allowed':>9}"
           f"{'peer, mesh':>12}{'tympan, mesh':>14}")
    for vector in VECTORS:
        columns = zip(vector.labels(own[-1]), vector.array(peer[-1]), vector.array(own[-1]),
                      vector.differences(own[-1], peer[-1]),
                      vector.differences(peer[0], peer[-1]), vector.differences(own[0], own[-1]),
                      strict=True)
        for name, theirs, ours, apart, theirs_by_mesh, ours_by_mesh in columns:
            yield (f"  {f'{name} [{vector.unit}]':22}{theirs:14.8f}{ours:14.8f}{apart:12.1e}"
                   f"{vector.allowed:9.0e}{theirs_by_mesh:12.1e}{ours_by_mesh:14.1e}")


def missed(peer: SectorRow, own: SectorRow) -> list[str]:
    """Names of the vectors whose difference is larger than allowed."""
    return [f"{own.film}: {', '.join(vector.names)}" for vector in VECTORS
            if not (vector.differences(own, peer) <= vector.allowed).all()]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peer-python", default=sys.executable, help="Python that has NGSolve")
    parser.add_argument("--only", default="", metavar="TEXT",
                        help="films whose name contains TEXT")
    parser.add_argument("-o", "--output", type=Path, help="also write all rows as JSON")
    options = parser.parse_args()
    rows, wrong = [], []
    for film in FILMS:
        if options.only not in film.name:
            continue
        print(film.name, flush=True)
        peer = peer_rows(options.peer_python, film)
        own = [own_row(film, factor) for factor in FACTORS]
        print("\n".join(table(peer, own)), flush=True)
        rows += [*peer, *own]
        wrong += missed(peer[-1], own[-1])
    if options.output:
        options.output.write_text(json.dumps([asdict(row) for row in rows], indent=1))
    if wrong:
        sys.exit("differences larger than allowed:\n" + "\n".join(wrong))
    print("all differences are within what is allowed")


if __name__ == "__main__":
    main()
