"""First limits of round films, held against a dense scan by the axisymmetric equations.

    python -m benchmarks.trials.first_limits [--films 300] [--keep FILE] [-o docs/first-limits.md]

Films of softening and hardening Ogden laws of one and two terms, and of the library, with plates,
thicknesses, stretches and weights of their own. ``tympan limits`` tells the first limit. The
equations are solved at many voltages up to beyond it: each state is asked whether it exists,
whether it is stable, whether the film gives way in itself there, and whether it is in tension; the
first crossing is then bisected. Interrupted, the command goes on with ``--keep``.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.trials.unknown_noise import rate
from tests.oracles import axisymmetric
from tests.oracles.unstable import least_stiffness
from tympan.base.errors import InputError
from tympan.fem.film.laws.ogden import Ogden
from tympan.fem.film.library import MATERIALS
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Film, Plate, Specimen
from tympan.studies.case import Case, Settings
from tympan.studies.limits import limits

SEED = 590
KINDS = ("softening", "hardening", "two terms", "library")
GRAVITY = 9.80665
#: States of the scan, evenly in the square of the voltage.
SCANNED = 100
#: How far beyond the told limit the scan goes, over its voltage.
BEYOND = 1.1
#: Where tympan tells no limit, up to which field of the flat film is scanned [V/m].
HIGHEST = 2e8
#: Difference of voltages beyond the told spread that is none.
SAME = 2e-3
#: What ends a scan where the film bends more sharply than the equations' polynomials do.
UNRESOLVED = "unresolved"
#: Bisections of a crossing: 1e-6 of the scan's step.
_BISECTED = 20
#: Radii at which a film is looked at, its edges among them.
_RADII = 9
#: Heaves over the gap that weights give.
HEAVES = (0.02, 0.4)

PAGE = """# First limits against a dense scan

`python -m benchmarks.trials.first_limits -o docs/first-limits.md` makes this page. It draws {count}
round films: Ogden laws of one term that soften (α 1.05 to 1.9) or harden (α 2.1 to 8), laws of two
terms, and laws of the library. Thickness, stretch, plate and weight are drawn, too.

`tympan limits` tells the first limit as the voltage rises. The axisymmetric equations are solved
at {scanned} voltages up to {beyond:g} times that. The first of them that has no equilibrium, or one
that is unstable, not in tension, or at which the film gives way in itself, is bisected.

{table}

Where a film is about to give way in itself, it bends so sharply at the plate that the equations'
polynomials of degree 96 do not resolve it: the scan then does not say what comes first.

A film is *the same* where both voltages differ by less than the told spread and {same:g} %.
"""


@dataclass(frozen=True)
class Compared:
    """A film, with the first limit that is told and that of the equations."""

    number: int
    kind: str
    film: str
    told: str
    voltage: float
    spread: float
    scanned: str
    exact: float

    @property
    def same(self) -> bool:
        """Whether both come at the same voltage; "none" is the same as beyond the scan."""
        if not self.voltage or not self.exact:
            return self.voltage == self.exact
        return abs(self.voltage / self.exact - 1) <= self.spread + SAME

    @property
    def known(self) -> bool:
        """Whether the equations say which limit comes first: one that is told comes before."""
        return self.scanned != UNRESOLVED or 0 < self.voltage < self.exact

    @property
    def missed(self) -> bool:
        """Whether a limit is told that comes after the first one."""
        return not self.same and self.exact > 0 and not 0 < self.voltage < self.exact


def drawn(number: int) -> tuple[str, Case, axisymmetric.Film] | None:
    """A film of a kind under a weight, for both; None where the weight pulls it too far."""
    random, kind = np.random.default_rng([SEED, number]), KINDS[number % len(KINDS)]
    if kind == "library":
        laws = [law.material for law in MATERIALS.values() if isinstance(law.material, Ogden)]
        law = laws[int(random.integers(len(laws)))]
    else:
        spans = {"softening": [(1.05, 1.9)], "hardening": [(2.1, 8.0)],
                 "two terms": [(1.05, 2.5), (2.5, 6.0)]}[kind]
        alpha = tuple(float(random.uniform(*span)) for span in spans)
        shear = 40e3 * random.dirichlet(np.ones(len(alpha)))
        law = Ogden(tuple((2 * shear / alpha).tolist()), alpha)
    inner, stretch = float(random.uniform(6e-3, 20e-3)), float(random.uniform(1.3, 3.2))
    thickness = float(np.exp(random.uniform(np.log(0.2e-3), np.log(1.5e-3))))
    specimen = Specimen(f"{kind} {number}", Circle(45e-3), Plate(Circle(inner)),
                        Film(thickness, (stretch, stretch), law, 4.7))
    film = axisymmetric.Film(inner, 45e-3, thickness, stretch,
                             axisymmetric.Ogden(law.mu, law.alpha), 4.7)
    heave = float(np.exp(random.uniform(*np.log(HEAVES)))) * (45e-3 - inner)
    try:
        force = axisymmetric.solve_deflection(film, heave).force
    except ArithmeticError:
        return None
    return kind, Case(specimen, mass=force / GRAVITY), film


def scan(film: axisymmetric.Film, force: float, highest: float) -> tuple[str, float]:
    """Kind and voltage [V] of the first limit up to one; nothing and 0 without."""
    squares = np.linspace(0.0, highest**2, SCANNED)
    for number, squared in enumerate(squares.tolist()):
        if kind := ends(film, force, squared**0.5):
            if not number:
                return kind, 0.0
            return kind, _bisected(lambda q: bool(ends(film, force, q**0.5)),
                                   float(squares[number - 1]), squared) ** 0.5
    return "", 0.0


def ends(film: axisymmetric.Film, force: float, voltage: float) -> str:
    """What is wrong with the state at a voltage; nothing where it is sound."""
    try:
        state = axisymmetric.solve_load(film, force, voltage)
    except axisymmetric.NoEquilibrium:
        return "none"
    except ArithmeticError:
        return UNRESOLVED
    if not state.stable:
        return "unstable"
    radii = np.geomspace(film.inner, film.outer, _RADII)
    if min(state.total2(radii).min(), state.total1(radii).min()) <= 0:
        return "tension"
    if min(least_stiffness(film, state, float(radius)) for radius in radii) <= 0:
        return "instability"
    return ""


def _bisected(beyond: Callable[[float], bool], low: float, high: float) -> float:
    for _ in range(_BISECTED):
        middle = (low + high) / 2
        low, high = (low, middle) if beyond(middle) else (middle, high)
    return (low + high) / 2


def compared(number: int) -> Compared | None:
    """A film by both; None where it cannot be drawn, or lies flat in compression."""
    made = drawn(number)
    if made is None:
        return None
    kind, case, film = made
    try:
        told = limits(case, Settings()).limit
    except InputError:
        return None
    thickness = film.thickness / film.prestretch**2
    highest = BEYOND * told.voltage_V if told else HIGHEST * thickness
    found, exact = scan(film, case.mass * GRAVITY, highest)
    words = (f"{1e6 * film.thickness:.0f} µm x {film.prestretch:.3f}, "
             f"{case.specimen.membrane.material}, {1e3 * case.mass:.3g} g")
    return Compared(number, kind, words, told.kind if told else "",
                    told.voltage_V if told else 0.0, told.spread if told else 0.0, found, exact)


def table_of(films: list[Compared]) -> str:
    """The table of the page."""
    lines = ["| films | drawn | of these not resolved | the same first limit | a later one is "
             "told, or none | largest difference of the same |", "|---|---|---|---|---|---|"]
    for kind in (*KINDS, "all"):
        every = [one for one in films if kind in (one.kind, "all")]
        own = [one for one in every if one.known]
        same = [one for one in own if one.same]
        most = max((abs(one.voltage / one.exact - 1) for one in same if one.exact), default=0.0)
        lines.append(" | ".join([
            f"| {kind}", str(len(every)), str(len(every) - len(own)), rate(len(same), len(own)),
            rate(sum(one.missed for one in own), len(own)), f"{most:.1e} |"]))
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--films", type=int, default=300)
    parser.add_argument("--keep", type=Path, default=None)
    parser.add_argument("-o", "--output", type=Path, default=None)
    asked = parser.parse_args()
    kept = ([json.loads(line) for line in asked.keep.read_text("utf-8").splitlines()]
            if asked.keep is not None and asked.keep.exists() else [])
    films = [Compared(**row) for row in kept if "film" in row]
    number = kept[-1]["number"] + 1 if kept else 0
    while len(films) < asked.films:
        one = compared(number)
        row = {"number": number} if one is None else asdict(one)
        if one is not None:
            films.append(one)
            print("" if one.same else "OTHER", one, flush=True)
        if asked.keep is not None:
            with asked.keep.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
        number += 1
    print(table_of(films))
    if asked.output is not None:
        asked.output.write_text(PAGE.format(count=len(films), scanned=SCANNED, beyond=BEYOND,
                                            same=100 * SAME, table=table_of(films)),
                                encoding="utf-8")


if __name__ == "__main__":
    main()
