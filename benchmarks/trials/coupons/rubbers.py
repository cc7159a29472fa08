"""Rubbers whose law is known: what a fit to their coupons makes of a film.

    python -m benchmarks.trials.coupons.rubbers [--seeds 40] [-o FILE.md]

Elastic rubbers of every law that a strip can have, pulled once at one rate along one axis, then
along both axes too; noise of 0.5 to 3 % of the stress. No fit may find a branch. A film of each is
solved by its own law and by the fitted one: with two modes within 5 %, with one mode within the
printed limits in 95 %. Viscous rubbers with a hold or several rates keep their branches.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import beta

from benchmarks.trials.coupons.limits import by_dop853, coupons_of
from tympan.fem.film.admissibility import inadmissible_stretch
from tympan.fem.film.laws import (
    ArrudaBoyce,
    Gent,
    MooneyRivlin,
    MooneyShare,
    NeoHooke,
    Ogden,
    Stiffened,
    Yeoh,
)
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Film, Material, Plate, Specimen
from tympan.studies.case import Case, Settings, solve
from tympan.studies.data.coupon import MODES, Coupons
from tympan.studies.material.branches import compare_in_time
from tympan.studies.material.families import FAMILIES
from tympan.studies.material.film import FilmDeflection, film_deflection
from tympan.studies.material.fit import best_offered, compare
from tympan.studies.material.time_in_runs import time_in_runs

#: Laws that a strip can have, and how many; those of a film about its mounted state have none.
LAWS = ("neo_hooke", "mooney_rivlin", "yeoh", "gent", "arruda_boyce", "ogden", "stiffened",
        "mooney_share")
#: Readings of a ramp, its rate [1/s], and the stretch it begins at.
_READINGS, _RATE, _FIRST = 60, 0.2, 1.02
#: The film: mass [kg] and voltage [V] at a modulus of 300 kPa.
_MODULUS, _MASS, _VOLTAGE = 300e3, 0.02, 2e3
#: Searches per shape constant: fewer than the command's, which would take an hour.
_STARTS = 3
#: Error of a deflection that is allowed where two modes were tested.
ALLOWED = 0.05


@dataclass(frozen=True)
class Rubber:
    """An elastic rubber: law, modulus [Pa], end of its tests, noise as a share of the stress."""

    seed: int
    law: Material
    modulus: float
    top: float
    noise: float

    @classmethod
    def drawn(cls, seed: int) -> Rubber:
        """One whose stress grows over its tests; the law by the seed's number."""
        random = np.random.default_rng([seed, 40])
        kind = LAWS[seed % len(LAWS)]
        modulus = float(np.exp(random.uniform(np.log(50e3), np.log(1e6))))
        top, noise = float(random.uniform(2.0, 3.5)), float(random.uniform(0.005, 0.03))
        while True:
            law = _law(kind, modulus, top, random)
            if inadmissible_stretch(law, 0.3, top) is None:
                return cls(seed, law, modulus, top, noise)

    def coupons(self, modes: tuple[str, ...]) -> Coupons:
        """One ramp in each mode, with times and noise."""
        random, parts = np.random.default_rng([self.seed, 41]), []
        for mode in modes:
            end = self.top if mode == "uniaxial" else 1 + 0.6 * (self.top - 1)
            stretch = np.linspace(_FIRST, end, _READINGS)
            across = stretch ** MODES[mode]
            _, stress, other, *_ = self.law.derivatives(stretch, across)
            if mode == "uniaxial":  # nothing pulls across
                assert np.abs(other).max() < 1e-8 * np.abs(stress).max()
            errors = 1 + self.noise * random.standard_normal(_READINGS)
            none = np.full(_READINGS, "")
            parts.append(Coupons(np.full(_READINGS, mode), stretch, stress * errors, none,
                                 np.full(_READINGS, mode), (stretch - 1) / _RATE))
        return Coupons.joined(parts)

    @property
    def case(self) -> Case:
        """A film of it under a mass and a voltage in proportion to its modulus."""
        film = Film(0.2e-3, (1.2, 1.2), self.law, 2.8)
        share = self.modulus / _MODULUS
        return Case(Specimen("film", Circle(30e-3), Plate(Circle(8e-3)), film),
                    mass=_MASS * share, voltage=_VOLTAGE * share**0.5)


def _law(kind: str, mu: float, top: float, random: np.random.Generator) -> Material:
    excess = top**2 + 2 / top - 3
    both = 2 * top**2 + top**-4 - 3  # a sheet to the same stretch does not lock
    share = float(random.uniform(0.05, 0.35))
    return {
        "neo_hooke": lambda: NeoHooke(mu),
        "mooney_rivlin": lambda: MooneyRivlin(mu * (1 - share) / 2, mu * share / 2),
        "yeoh": lambda: Yeoh((mu / 2, -mu * share / 10 / excess, mu * share / 4 / excess**2)),
        "gent": lambda: Gent(mu, both * float(random.uniform(1.3, 6))),
        "arruda_boyce": lambda: ArrudaBoyce(
            mu, (both / 3 + 1) ** 0.5 * float(random.uniform(1.1, 2.0))),
        "ogden": lambda: Ogden((mu * (1 - share / 10), mu * share / 30),
                               (float(random.uniform(1.5, 2.2)), float(random.uniform(4, 7)))),
        "stiffened": lambda: Stiffened(NeoHooke(mu), share, 3.5),
        "mooney_share": lambda: MooneyShare(NeoHooke(mu), share, 1.44),
    }[kind]()


@dataclass(frozen=True)
class Outcome:
    """What a fit made of a rubber; deflections [m], ``truth`` by its own law."""

    rubber: Rubber
    modes: int
    branches: int
    best: str
    truth: float
    film: FilmDeflection | None

    @property
    def error(self) -> float:
        """Of the deflection by the fitted law, relative; inf where there is none."""
        if self.film is None or self.film.deflection_m is None:
            return np.inf
        return abs(self.film.deflection_m / self.truth - 1)

    @property
    def inside(self) -> bool:
        """Whether the printed limits hold the truth; an open end holds all."""
        if self.film is None:
            return False
        low, high = self.film.low_m, self.film.high_m
        return (low is None or low <= self.truth) and (high is None or self.truth <= high)


def outcome(rubber: Rubber, modes: tuple[str, ...], starts: int = _STARTS,
            names: tuple[str, ...] | None = None) -> Outcome:
    """Fit a rubber's coupons as the command does, and solve its film by what is offered."""
    coupons = rubber.coupons(modes)
    if time_in_runs(coupons).shown:
        branched = compare_in_time(coupons)
        return Outcome(rubber, len(modes), branched[0].count, branched[0].law.family.name,
                       np.nan, None)
    fits = compare(coupons, names, starts=starts, quick=True)
    truth = solve(rubber.case, Settings()).deflection_m
    best = best_offered(fits)
    assert truth is not None
    assert best is not None
    return Outcome(rubber, len(modes), 0, best.family.name, truth,
                   film_deflection(rubber.case, Settings(), coupons, fits))


def viscous(seed: int) -> Coupons:
    """A neo-Hookean rubber with a branch or two: of even seeds a ramp and its hold, else rates."""
    random = np.random.default_rng([seed, 42])
    modulus = float(np.exp(random.uniform(np.log(20e3), np.log(500e3))))
    top, rate = float(random.uniform(1.6, 2.8)), float(np.exp(random.uniform(-4, -1)))
    duration = (top - 1) / rate
    up = np.linspace(duration / 30, duration, 30)
    parts = []
    if seed % 2 == 0:
        time = np.append(up, duration + np.geomspace(duration / 30, 20 * duration, 30))
        parts.append(("ramp and hold", time, np.minimum(1 + rate * time, top)))
    else:
        parts += [(f"{factor:g}", up / factor, 1 + rate * up) for factor in (1, 5, 25)]
    coupons = coupons_of(parts)
    stress = FAMILIES["neo_hooke"].stress(*coupons.in_plane, np.array([modulus]))
    for share in random.uniform(0.2, 1.0, 1 + seed % 3 % 2):
        tau = duration * float(np.exp(random.uniform(-1.5, 1.5)))
        for run in coupons.timed_runs.values():
            stress[run] += share * modulus * by_dop853(coupons.time[run], coupons.stretch[run],
                                                       "uniaxial", tau)
    noise = 1 + random.uniform(0.005, 0.02) * random.standard_normal(len(coupons))
    return replace(coupons, stress=stress * noise)


def branches_found(seed: int) -> int:
    """Number of branches that the fit finds in a viscous rubber."""
    coupons = viscous(seed)
    return compare_in_time(coupons, ["neo_hooke"])[0].count


def _share(count: int, every: int) -> str:
    """Share with its 95 % interval (Clopper and Pearson, Biometrika 26, 404, 1934)."""
    low = beta.ppf(0.025, count, every - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, every - count) if count < every else 1.0
    return f"{count} of {every} ({100 * low:.0f} to {100 * high:.0f} %)"


def report(outcomes: list[Outcome], counts: list[int]) -> str:
    """Counts with their intervals."""
    strips, both = ([item for item in outcomes if item.modes == number] for number in (1, 2))
    widths = [100 * (item.film.high_m - item.film.low_m) / 2 / item.truth for item in strips
              if item.film and item.film.high_m is not None and item.film.low_m is not None]
    rows = [
        ("elastic", "branches found", [item.branches > 0 for item in outcomes]),
        ("elastic, two modes", "deflection within 5 %", [item.error <= ALLOWED for item in both]),
        ("elastic, two modes", "limits hold the truth", [item.inside for item in both]),
        ("elastic, one mode", "deflection within 5 %", [item.error <= ALLOWED for item in strips]),
        ("elastic, one mode", "limits hold the truth", [item.inside for item in strips]),
        ("viscous, a hold or three rates", "branches found", [count > 0 for count in counts])]
    return "\n".join([
        "| rubbers | what | count, 95 % interval |", "|---|---|---|",
        *(f"| {kind} | {what} | {_share(sum(hits), len(hits))} |" for kind, what, hits in rows),
        "", f"Half the width of the limits with one mode: median {np.median(widths):.2g} %, "
        f"largest {max(widths):.2g} % of the deflection."])


def main() -> None:
    """Print a line for each rubber, then the counts."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=40, help="elastic rubbers, a quarter viscous")
    parser.add_argument("-o", "--output", type=Path, help="also write the counts")
    options = parser.parse_args()
    outcomes = []
    for seed in range(options.seeds):
        rubber = Rubber.drawn(seed)
        for modes in (("uniaxial",), ("uniaxial", "equibiaxial")):
            item = outcome(rubber, modes)
            outcomes.append(item)
            film = item.film
            low, high = (None, None) if film is None else (film.low_m, film.high_m)
            limits = " to ".join("none" if end is None else f"{1e3 * end:.3f}"
                                 for end in (low, high))
            print(f"{seed:3d} {rubber.law.law:14s} {len(modes)} mode(s), noise "
                  f"{100 * rubber.noise:.1f} %: {item.branches} branches, {item.best:14s} truth "
                  f"{1e3 * item.truth:.3f} mm, off {100 * item.error:5.2f} %, limits {limits} mm"
                  f"{'' if item.inside else '  OUTSIDE'}", flush=True)
    branches = [branches_found(seed) for seed in range(options.seeds // 4)]
    print("branches of viscous rubbers:", *branches)
    text = report(outcomes, branches)
    print(text)
    if options.output:
        options.output.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
