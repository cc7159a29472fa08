"""A neo-Hookean film with viscous branches fitted to the six ranges of the paper's Table 2.

Constants are changed in films reduced once (:mod:`tympan.studies.films.film`): what a film
is made of is in their points as it is in the field model's. Ranges are read at the ends of the
levels of figure 14, whose levels are lost: any seed's may stand for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import resources

import numpy as np
from scipy.optimize import least_squares

from tympan.base.arrays import Array
from tympan.fem.film.laws import NeoHooke
from tympan.fem.film.library import load_specimen
from tympan.fem.membrane.model import Model
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen, ViscousBranch
from tympan.paper import published
from tympan.paper.figures import Criterion, Decay, settling_times
from tympan.studies.case import Settings, build_model
from tympan.studies.films.film import FilmLoads, NoBalance, ReducedFilm
from tympan.studies.films.reduction import reduced_film
from tympan.studies.lumped.film_response import film_deflections, film_motion
from tympan.studies.motion import Trace
from tympan.studies.signals import Pieces, Signal, step

_RIG = Rig()
#: What is searched: moduli [Pa], permittivity, times [s].
_MODULUS, _PERMITTIVITY = (3e3, 2e5), (1.2, 20.0)
_BRANCH_MODULUS, _BRANCH_TIME = (1e3, 2e8), (0.3, 3e4)
#: Where the search begins, by the number of branches: moduli [Pa] and times [s].
_STARTS: dict[int, list[list[float]]] = {
    0: [[]], 1: [[1e6, 30.0], [5e6, 8.0], [2e5, 100.0]], 2: [[1e6, 30.0, 3e6, 5.0]]}
#: A range where the film pulls in [m], far from any of the paper's.
_PULLED_IN = 5e-3
#: How long and how often a step's response is read [s], the error of its steps over the gap, what
#: the paper's sensor sees [m], dampers that are tried [N s/m].
_LONG, _INTERVAL, _CLOSE, _SEEN = 4.0, 1e-3, 1e-6, 1e-6
_DAMPERS = np.linspace(0.06, 0.13, 8)


@dataclass(frozen=True)
class Constants:
    """Of a film: shear modulus at rest [Pa], relative permittivity, branches."""

    modulus: float
    permittivity: float
    branches: tuple[ViscousBranch, ...] = ()

    @classmethod
    def of(cls, logarithms: Array) -> Constants:
        """Of the logarithms of modulus, permittivity, and modulus and time of each branch."""
        modulus, permittivity, *rest = np.exp(logarithms).tolist()
        return cls(modulus, permittivity,
                   tuple(map(ViscousBranch, rest[::2], rest[1::2])))

    def applied(self, specimen: Specimen) -> Specimen:
        """The specimen of a film with these constants."""
        return replace(specimen, membrane=replace(
            specimen.membrane, material=NeoHooke(self.modulus),
            relative_permittivity=self.permittivity, branches=self.branches))


@dataclass(frozen=True, eq=False)
class Fit:
    """Constants that come nearest to Table 2, and the ranges they give [m], (masses, actuators)."""

    constants: Constants
    ranges: Array

    @property
    def misfit(self) -> float:
        """Root mean square over the six ranges [m]."""
        return float(np.sqrt(np.mean((self.ranges - published.ranges()) ** 2)))


def models(constants: Constants) -> list[Model]:
    """Field models of the paper's actuators."""
    folder = resources.files("tympan.studies.shipped")
    return [build_model(constants.applied(load_specimen(str(folder / f"{name}.toml"))), Settings())
            for name in published.NAMES]


def reduced_films(constants: Constants) -> list[ReducedFilm]:
    """The paper's actuators reduced, for its masses and voltages."""
    forces = [float(_RIG.force(mass)) for mass in published.MASSES]
    return [reduced_film(model, forces, published.HIGHEST) for model in models(constants)]


def with_constants(films: Sequence[ReducedFilm], constants: Constants) -> list[ReducedFilm]:
    """The same films of another material."""
    return [replace(film, specimen=constants.applied(film.specimen)) for film in films]


def fitted(films: Sequence[ReducedFilm], signal: Pieces, branches: int) -> Fit:
    """The film with so many branches whose ranges come nearest to Table 2."""
    def ranges(logarithms: Array) -> Array:
        changed = with_constants(films, Constants.of(logarithms))
        return ranges_in_time(changed, signal) if branches else ranges_at_rest(changed)

    def misses(logarithms: Array) -> Array:
        return np.asarray(1e3 * (ranges(logarithms) - published.ranges()).ravel())

    bounds = np.log([_MODULUS, _PERMITTIVITY, *([_BRANCH_MODULUS, _BRANCH_TIME] * branches)]).T
    solutions = [least_squares(misses, np.log([20e3, 4.7, *start]), diff_step=1e-4, bounds=bounds)
                 for start in _STARTS[branches]]
    best = min(solutions, key=lambda solution: float(solution.cost)).x
    return Fit(Constants.of(best), ranges(best))


def ranges_in_time(films: Sequence[ReducedFilm], signal: Pieces) -> Array:
    """At the ends of a signal's levels [m], shape (masses, actuators)."""
    count = len(published.MASSES)
    ends = np.nextafter(signal.breaks[1:], 0.0)
    ranges = [np.ptp(film_deflections(film, [signal] * count, published.MASSES,
                                      np.append(signal.breaks[0], ends)), axis=1)
              for film in films]
    return np.asarray(np.nan_to_num(np.array(ranges).T, nan=_PULLED_IN))


def ranges_at_rest(films: Sequence[ReducedFilm]) -> Array:
    """Between the paper's voltages, each held for ever [m], shape (masses, actuators)."""
    forces = np.array([float(_RIG.force(mass)) for mass in published.MASSES])

    def travel(film: ReducedFilm) -> Array:
        low, high = (film.at_rest(FilmLoads(forces, voltage**2))[:, 0]
                     for voltage in (published.LOWEST, published.HIGHEST))
        return np.asarray(high - low)

    try:
        return np.array([travel(film) for film in films]).T
    except NoBalance:
        return np.full((len(published.MASSES), len(films)), _PULLED_IN)


def swing(film: ReducedFilm, mass: float, damper: float, signal: Signal) -> tuple[Array, Array]:
    """Times [s] and deflections [m] of a plate with its mass [kg] on a damper [N s/m]."""
    rig = replace(_RIG, plate_damping=damper)
    motion = film_motion(film, signal, mass, rig, inertia=True, error=_CLOSE)
    moments = list(motion.moments())
    time = np.arange(0.0, signal.end, _INTERVAL)
    return time, Trace(np.array([moment.time for moment in moments])).at(
        np.array([moment.deflection for moment in moments]), time)


def settling(films: Sequence[ReducedFilm]) -> tuple[float, Criterion]:
    """The damper [N s/m] with which plates come to rest within 1 µm nearest to the paper's times.

    Of those tried. Another threshold asks for another damper, with the same times.
    """
    jump = step(*published.STEP, 0.0, _LONG)

    def settled(damper: float) -> Criterion:
        decays = [[Decay.of(*swing(film, mass, damper, jump)) for film in films]
                  for mass in published.MASSES]
        return settling_times(decays, "length", _SEEN)

    tried = {float(damper): settled(float(damper)) for damper in _DAMPERS}
    best = min(tried, key=lambda damper: tried[damper].rms)
    return best, tried[best]
