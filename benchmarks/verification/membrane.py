"""Claims about the finite elements against the axisymmetric equations."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.verification.claim import Pair, claim
from benchmarks.verification.films import (
    MU,
    A,
    B,
    G,
    T,
    annulus,
    bulge,
    disc,
    oracle,
    quarter_annulus,
    quarter_disc,
    rim_peak,
)
from benchmarks.verification.references import INCH, PSI, VM218, rubber_disc
from tests.oracles.axisymmetric import neo_hooke, solve_deflection, solve_load
from tests.oracles.inflation import Disc, Loads, hencky, minimise
from tests.oracles.laws import SAMPLES
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.film.laws import MooneyRivlin, NeoHooke
from tympan.fem.membrane.loading import Loading
from tympan.geometry.specimen import Film
from tympan.studies.case import Settings, build_model

FORCE, HEAVE = 17.9e-3 * G, 10e-3


@claim("Plate force at 10 mm deflection, and deflection under 17.9 g, every law, "
       "without and with voltage",
       reference="axisymmetric equations, spectral Ritz", tolerance=2e-6)
def every_law() -> Iterator[Pair]:
    """At the default mesh."""
    for name, sample in SAMPLES.items():
        model = build_model(annulus(sample.law), Settings())
        film = oracle(sample.reference)
        for voltage in (0.0, 4000.0):
            words = f"{name}, {voltage / 1e3:g} kV"
            yield Pair(f"{words}, F", held(model, HEAVE, voltage).state.force,
                       solve_deflection(film, HEAVE, voltage).force, "N")
            outcome = equilibrium(model, FORCE, voltage)
            yield Pair(f"{words}, deflection", outcome.state.plate.deflection,
                       solve_load(film, FORCE, voltage).deflection,
                       "m")


@claim("Largest stress at the plate at 10 mm deflection, every law",
       reference="axisymmetric equations, spectral Ritz",
       tolerance=1e-3)
def rim_stress() -> Iterator[Pair]:
    """The hardest number of a membrane: at the default mesh."""
    for name, sample in SAMPLES.items():
        model = build_model(annulus(sample.law), Settings())
        exact = solve_deflection(oracle(sample.reference), HEAVE)
        yield Pair(f"{name}, σ₁", rim_peak(model, held(model, HEAVE).state), float(exact.sigma1(A)),
                   "Pa")


@claim("Gas pressure on film and plate, and on the film alone", tolerance=1e-6,
       reference="axisymmetric equations with follower pressure, Ritz on the enclosed volume")
def gas_pressure() -> Iterator[Pair]:
    """The plate's share is a force p πa². Here the gas pushes along the force: it is negative."""
    model, film, plate = build_model(annulus(NeoHooke(MU)),
                                     Settings()), oracle(neo_hooke(MU)), math.pi * A**2
    for pressure, voltage in ((50.0, 0.0), (50.0, 4000.0), (400.0, 0.0)):
        words = f"{pressure:g} Pa, {voltage / 1e3:g} kV"
        both = equilibrium(model, 0.05, voltage, -pressure).state
        yield Pair(f"{words}, film and plate, deflection", both.plate.deflection,
                   minimise(film, Loads(pressure, 0.05 + pressure * plate, voltage)).apex, "m")
        alone = equilibrium(model, 0.05 - pressure * plate, voltage, -pressure).state
        yield Pair(f"{words}, film alone, deflection", alone.plate.deflection,
                   minimise(film, Loads(pressure, 0.05, voltage)).apex, "m")


@claim("The film's own weight", reference="axisymmetric equations with weight, Ritz",
       tolerance=1e-6)
def own_weight() -> Iterator[Pair]:
    """Of 1 000 kg/m³ and, to be seen, of ten times as much."""
    for density in (1e3, 1e4):
        model = build_model(annulus(NeoHooke(MU), density=density), Settings(), Loading(gravity=G))
        yield Pair(f"{density:g} kg/m³, deflection without load",
                   equilibrium(model, 0.0, 0.0).state.plate.deflection,
                   minimise(oracle(neo_hooke(MU)), Loads(weight=density * G * T)).apex, "m")


@claim("ANSYS VM218, inflated rubber disc, by finite elements", tolerance=1e-6,
       reference="axisymmetric equations with follower pressure, Ritz")
def vm218() -> Iterator[Pair]:
    """Fourth-order triangles, without a plate."""
    film = Film(0.5 * INCH, (1.0, 1.0), MooneyRivlin(80 * PSI, 20 * PSI), 0.0)
    model = quarter_disc(4, 6, 7.5 * INCH, film)
    steps = [4, 10, 17, 24, 29, 33, 36, 38]
    heights = dict(zip(steps, bulge(model, [step * PSI for step in steps], 2.3 * INCH),
                       strict=True))
    for pressure, _ in VM218:
        yield Pair(f"apex at {pressure} psi", heights[pressure] / INCH,
                   minimise(rubber_disc(), Loads(pressure * PSI)).apex / INCH, "in")


@claim("Flat membrane under small pressure by finite elements", tolerance=1e-4,
       reference="Hencky's series with E = 3μ, ν = 1/2; "
                 "strains of 2e-5, by which the two may differ")
def hencky_disc() -> Iterator[Pair]:
    """Without prestress; and with the ODE's own number, which is closer.

    Kept from wrinkling: its tension is smaller than the residual one of a film that may wrinkle.
    """
    pressure = 1e-3
    model = replace(quarter_disc(4, 4, B, Film(T, (1.0, 1.0), NeoHooke(MU), 0.0)), wrinkles=False)
    exact = B * (pressure * B / (3 * MU * T)) ** (1 / 3) * hencky(0.5)[1]
    apex = bulge(model, [pressure], exact)[0]
    yield Pair("apex at 1 mPa", apex, exact, "m")
    yield Pair("apex at 1 mPa, by the ODE", apex,
               minimise(disc(B, T, neo_hooke(MU)), Loads(pressure)).apex, "m")


@claim("Prestretched disc under pressure",
       reference="axisymmetric equations with follower pressure, Ritz",
       tolerance=1e-6)
def prestretched_disc() -> Iterator[Pair]:
    """Without a plate, stretched by √5, up to a high dome."""
    model = quarter_disc(4, 6, B, annulus(NeoHooke(MU)).membrane)
    film = Disc(0.0, B, T, math.sqrt(5), neo_hooke(MU))
    for pressure, apex in zip((20.0, 100.0, 200.0), bulge(model, [20.0, 100.0, 200.0], 1e-3),
                              strict=True):
        yield Pair(f"apex at {pressure:g} Pa", apex, minimise(film, Loads(pressure)).apex, "m")


#: Element order, sizes of the meshes, and the orders that are asked for: of force and deflection,
#: of the peak stress.
ORDERS = ((1, (8, 16, 32), 2, 1), (2, (4, 8, 16), 4, 2), (3, (4, 8), 6, 3), (4, (2, 4), 8, 4))


def errors(order: int, count: int) -> tuple[float, float, float]:
    """Relative errors of force and rim stress at 15 mm, and of the deflection under 17.9 g."""
    model, film = quarter_annulus(order, count), oracle(neo_hooke(MU))
    exact, loaded = solve_deflection(film, 15e-3), solve_load(film, FORCE)
    state = held(model, 15e-3).state
    return (abs(state.force / exact.force - 1),
            abs(equilibrium(model, FORCE, 0.0).state.plate.deflection / loaded.deflection - 1),
            abs(rim_peak(model, state) / float(exact.sigma1(A)) - 1))


@claim("Observed orders of convergence on meshes of one family, elements of order 1 to 4",
       tolerance=0.2,
       reference="theory: 2p for force and deflection, p for the peak stress at the rim")
def orders() -> Iterator[Pair]:
    """Base-two logarithm of the errors' ratio at the last halving."""
    for order, counts, energy, stress in ORDERS:
        coarse, fine = (np.array(errors(order, count)) for count in counts[-2:])
        rates = np.log2(coarse / fine)
        for name, rate, theory in zip(("force", "deflection", "rim stress"), rates,
                                      (energy, energy, stress),
                                      strict=True):
            yield Pair(f"P{order}, {name}, {counts[-2]} to {counts[-1]} elements a side",
                       float(rate), theory,
                       at_least=True)
