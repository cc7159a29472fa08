"""Claims about the references themselves: against published numbers, each other and asymptotics."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from benchmarks.verification.claim import Pair, claim
from benchmarks.verification.films import MU, A, B, T, disc, oracle
from tests.oracles.axisymmetric import Material, neo_hooke, shoot_deflection, solve_deflection
from tests.oracles.inflation import Disc, Loads, hencky, minimise, shoot
from tests.oracles.laws import rivlin

INCH, PSI = 0.0254, 6894.757293168361
#: Pressure [psi] and apex [in] of the disc of ANSYS VM218: 7.5 in, half an inch thick, Mooney 80
#: and 20 psi.
VM218 = ((4, 2.2503), (24, 5.6823), (38, 10.1054))


def rubber_disc() -> Disc:
    """The disc of VM218."""
    return disc(7.5 * INCH, 0.5 * INCH, mooney(80 * PSI, 20 * PSI))


def mooney(first: float, second: float) -> Material:
    """Mooney's law from its invariants, constants in Pa."""
    return rivlin(lambda i1, i2: first * (i1 - 3) + second * (i2 - 3), lambda i1: first + 0 * i1,
                  second)


@claim("Axisymmetric equations of the annulus by two methods",
       reference="shooting against a spectral Ritz method",
       tolerance=1e-9)
def annulus_by_two_methods() -> Iterator[Pair]:
    """Held plate; force, gas pressure and own weight on a free one."""
    film = oracle(neo_hooke(MU))
    for heave, voltage in ((15e-3, 0.0), (10e-3, 5e3)):
        ritz, shot = (solve(film, heave, voltage) for solve in (solve_deflection, shoot_deflection))
        yield Pair(f"F at {heave * 1e3:g} mm, {voltage / 1e3:g} kV", ritz.force, shot.force, "N")
        yield Pair(f"σ₁ at the rim at {heave * 1e3:g} mm, {voltage / 1e3:g} kV",
                   float(ritz.sigma1(A)),
                   float(shot.sigma1(A)), "Pa")
    for loads in (Loads(30.0, 0.1, 3e3), Loads(100.0), Loads(weight=9.80665, voltage=5e3)):
        ritz, shot = minimise(film, loads), shoot(film, loads)
        yield Pair(f"deflection at {loads.pressure:g} Pa, {loads.force:g} N, "
                   f"{loads.voltage / 1e3:g} kV, "
                   f"{loads.weight:.3g} Pa weight", ritz.apex, shot.apex, "m")


@claim("ANSYS VM218, inflated rubber disc, by shooting",
       reference="Ritz method; Mooney 80/20 psi, R 7.5 in, h 0.5 in",
       tolerance=1e-8)
def vm218_by_two_methods() -> Iterator[Pair]:
    """By shooting for the slope at the centre, and with the enclosed volume in Ritz's potential."""
    for pressure, _ in VM218:
        ritz = minimise(rubber_disc(), Loads(pressure * PSI))
        centre = float(ritz.meridian(np.array([1e-3 * INCH]))[0][0])
        shot = shoot(rubber_disc(), Loads(pressure * PSI), 1.002 * centre)
        yield Pair(f"apex at {pressure} psi", shot.apex / INCH, ritz.apex / INCH, "in")


@claim("ANSYS VM218 by the axisymmetric equations", tolerance=2.3e-5,
       reference="2.2503, 5.6823 and 10.1054 in, known to their last digit "
                 "from an earlier solution of the equations")
def vm218_rounded() -> Iterator[Pair]:
    """The published 6.2 and 10.9 in at higher pressures were read off a graph and are wrong."""
    for pressure, rounded in VM218:
        yield Pair(f"apex at {pressure} psi",
                   minimise(rubber_disc(), Loads(pressure * PSI)).apex / INCH, rounded, "in")


@claim("Hencky's series for a clamped membrane under pressure: b₀", tolerance=3e-5,
       reference="Hencky (1915) as corrected by Fichter, NASA TP-3658 (1997), "
                 "whose numbers were not read there again")
def hencky_constants() -> Iterator[Pair]:
    """Of the series as summed here."""
    for poisson, constant in ((0.2, 1.6827), (0.3, 1.7244), (0.4, 1.7769)):
        yield Pair(f"ν = {poisson}", hencky(poisson)[0], constant)


def hencky_ratio(pressure: float) -> float:
    """Apex of a neo-Hooke disc of the project's size by the ODE over Hencky's, E = 3μ, ν = 1/2."""
    film = disc(B, T, neo_hooke(MU))
    return minimise(film, Loads(pressure)).apex / (B * (pressure * B / (3 * MU * T)) ** (1 / 3)
                                                   * hencky(0.5)[1])


@claim("Inflated neo-Hooke disc tends to Hencky's as the pressure goes to zero", tolerance=2e-6,
       reference="Hencky's series with E = 3μ, ν = 1/2; "
                 "the difference must fall as the strain, p^(2/3)")
def hencky_limit() -> Iterator[Pair]:
    """1e-5 Pa and 1e-4 Pa are strains of 1e-6 and 5e-6."""
    low, high = hencky_ratio(1e-5), hencky_ratio(1e-2)
    yield Pair("w₀ over Hencky's at 1e-5 Pa", low, 1.0)
    share = 1e-3 ** (2 / 3)
    yield Pair("the same extrapolated to p = 0", (low - share * high) / (1 - share), 1.0)


@claim("Order at which the disc tends to Hencky's", reference="p^(2/3)", tolerance=1e-3)
def hencky_order() -> Iterator[Pair]:
    """From 1 mPa to 10 mPa."""
    yield Pair("exponent", math.log10((hencky_ratio(1e-2) - 1) / (hencky_ratio(1e-3) - 1)), 2 / 3)
