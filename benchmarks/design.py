"""Random requirements, and how many films of finite elements that scatter fail their answers.

    python -m benchmarks.design [--count 20] [--films 100] [--first 0] [--designs 128]

Each requirement is drawn about a random film: what is wanted is some share of what that film has.
The best film for it is drawn again with its tolerances, each copy is solved by finite elements on
a mesh of its own, and those that miss a bound are counted. Where the answer is that no film keeps
the bounds, random designs are drawn with their tolerances: of none may more copies keep these than
of the answer, by reduced films. Copies of the one that does so most often are solved by finite
elements.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.random import default_rng
from scipy.stats import binomtest, qmc

from tympan.base.arrays import Array
from tympan.base.points import drawn_points
from tympan.base.process.threads import one_thread
from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig
from tympan.studies.case import Case, Settings
from tympan.studies.design.design import design
from tympan.studies.design.exact import ExactFilm
from tympan.studies.design.requirements import Requirements
from tympan.studies.design.scatter import ScatteredFilms
from tympan.studies.design.search import Search
from tympan.studies.design.space import DesignSpace
from tympan.studies.limits.voltages import first_limit
from tympan.studies.wanted import QUANTITIES

#: Copies of a random design by reduced films: a share of 95 % is known within some 3 %.
_COPIES = 256
#: Copies of the best one of them, by which it is compared.
_AGAIN = 2048
#: Films that are drawn, by the name of their material: virgin thickness [mm] and prestretch.
FILMS = {"vhb-4910": (1.0, (1.8, 2.6)), "vhb-4910-neo-hooke": (1.0, (1.8, 2.6))}
#: Quantities of which some are wanted.
WANTED = ("stroke", "blocked_force", "frequency")


@dataclass(frozen=True)
class Outcome:
    """What became of a requirement: films that failed of those that were solved, and seconds.

    ``promised``: the share of films that keep the bounds by reduced films; ``random``: the same of
    the random design that does so most often, whose films are then those solved.
    """

    status: str
    failed: int
    films: int
    seconds: float
    promised: float
    random: float | None = None

    def __str__(self) -> str:
        others = "" if self.random is None else f", of random designs {1 - self.random:.1%}"
        return (f"{self.status:10s} {self.failed:3d} of {self.films:3d} fail, "
                f"{1 - self.promised:.1%} by reduced films{others}, {self.seconds:.1f} s of "
                "processor")


def requirements(folder: Path, seed: int) -> Requirements:
    """Random requirements, written to a file and read from it."""
    rng = default_rng(seed)
    name = str(rng.choice(list(FILMS)))
    thickness, stretches = FILMS[name]
    a, b = sorted(rng.uniform(30, 60, 2))[::-1]
    plate = rng.uniform(0.18, 0.3) * b
    stretch = rng.uniform(*stretches)
    (folder / "film.toml").write_text(
        f'name = "film"\n[frame]\nshape = "ellipse"\nsemi_axes = ["{a} mm", "{b} mm"]\n'
        f'[plate]\nshape = "circle"\nradius = "{plate} mm"\n'
        f'[membrane]\nmaterial = "{name}"\nthickness = "{thickness} mm"\n'
        f'prestretch = [{stretch}, {stretch}]\nrelative_permittivity = 4.7\n', encoding="utf-8")
    specimen, mass = load_specimen(folder / "film.toml"), rng.uniform(5e-3, 25e-3)
    limit = first_limit(Case(specimen, mass=mass), Settings())
    assert limit is not None
    voltage = rng.uniform(0.4, 0.7) * limit.voltage_V
    film = ExactFilm(specimen, mass, voltage, Rig(), Settings())
    chosen = rng.choice(WANTED, 2, replace=False)
    wanted = [f'{key} = "{rng.uniform(0.3, 0.8) * float(QUANTITIES[key].of(film)[0])} '
              f'{QUANTITIES[key].unit}"' for key in chosen]
    free = rng.choice(["voltage", "frame_area", "stroke", ""])
    if free and free not in chosen:
        wanted.append(f'{free} = "{"largest" if free == "stroke" else "least"}"')
    load = f'voltage = "{voltage} V"'
    vary = [f'"frame.semi_axes.0" = ["{0.8 * a} mm", "{1.2 * a} mm"]',
            f'"plate.radius" = ["{0.7 * plate} mm", "{1.3 * plate} mm"]',
            f'"membrane.prestretch" = [{0.9 * stretch}, {1.1 * stretch}]']
    if free == "voltage":
        load, vary = "", [*vary, f'voltage = ["{0.4 * voltage} V", "{1.2 * voltage} V"]']
    lines = ['specimen = "film.toml"', f'mass = "{mass} kg"', load, "[want]",
             f"tension_margin = {rng.uniform(1.0, 1.2)}", *wanted, "[vary]", *vary]
    (folder / "wanted.toml").write_text("\n".join(lines), encoding="utf-8")
    return Requirements.read(folder / "wanted.toml")


def tried(seed: int, count: int, designs: int) -> Outcome:
    """One requirement, and so many films that scatter about its answer, or random designs."""
    with tempfile.TemporaryDirectory() as folder:
        wanted = requirements(Path(folder), seed)
    began = time.process_time()
    with one_thread():  # as the command has it
        result = design(wanted)
    seconds = time.process_time() - began
    film = result.films[0]
    assert film.reached is not None
    space, random = DesignSpace.of(wanted, wanted.specimens[0], Settings()), default_rng(seed)
    promised, likeliest = film.reached.probability, None
    if result.status == "met":
        values = np.array([number.value for number in film.numbers.values()])
    else:
        values, likeliest = _likeliest(space, designs, seed)
    failed = _failed(space, values, random.random((count, space.inputs)))
    return Outcome(result.status, failed, count, seconds, promised, likeliest)


def _likeliest(space: DesignSpace, designs: int, seed: int) -> tuple[Array, float]:
    """Of random designs the one of which most copies keep all bounds, and that share of these.

    By reduced films, but without the search: what it says of margins is not asked.
    """
    search = Search(space, space.requirements.kept(space.specimen), "")
    places = space.values(qmc.Sobol(len(space.variables), rng=default_rng(seed)).random(designs))
    points = drawn_points(space.inputs, _COPIES, seed)
    shares = [float(ScatteredFilms.of(search, values, points).kept({}).mean())
              for values in places]
    best = places[int(np.argmax(shares))]
    # By other copies: the most of many shares is more than that design's own.
    again = ScatteredFilms.of(search, best, drawn_points(space.inputs, _AGAIN, seed + 1))
    return best, float(again.kept({}).mean())


def _failed(space: DesignSpace, values: Array, points: Array) -> int:
    """How many copies of a design, at points from 0 to 1, miss a bound by finite elements."""
    wanted, voltage, drawn = space.requirements, space.voltage(values), space.scattered(values,
                                                                                         points)
    scattering = [bound for bound in wanted.kept(space.specimen).values()
                  if bound.quantity.scatters]
    failed = 0
    for row, load, across, strength in zip(drawn.films.rows, drawn.loads, drawn.across,
                                           drawn.films.strength, strict=True):
        exact = ExactFilm(space.family.box.member(row), float(load) / wanted.rig.gravity, voltage,
                          wanted.rig, Settings(), wanted.margin, float(across[1]) / voltage,
                          float(strength))
        failed += not all(bound.misses(exact)[0] <= 0 for bound in scattering)
    return failed


def main() -> None:
    """Print each requirement, then all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--films", type=int, default=100)
    parser.add_argument("--designs", type=int, default=128)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    outcomes = []
    for seed in range(options.first, options.first + options.count):
        outcome = tried(seed, options.films, options.designs)
        outcomes.append(outcome)
        print(f"{seed:3d} {outcome}", flush=True)
    met = [each for each in outcomes if each.status == "met"]
    failed, films = sum(each.failed for each in met), sum(each.films for each in met)
    if films:
        limits = binomtest(failed, films).proportion_ci(method="wilson")
        print(f"{failed} of {films} fail: {failed / films:.2%} ({limits.low:.2%} to "
              f"{limits.high:.2%})")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
