"""Claims about pull-in, the branch beyond it, and the loss of tension before it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.verification.claim import Pair, claim
from benchmarks.verification.films import MU, A, B, G, annulus, oracle, quarter_annulus
from tests.oracles.axisymmetric import (
    Film,
    neo_hooke,
    pull_in_voltage,
    shoot_deflection,
    solve_load,
)
from tests.oracles.unstable import branch_voltage, slack_voltage
from tympan.fem.equilibrium.arc_length import Branch
from tympan.fem.equilibrium.constraints import held_plate
from tympan.fem.equilibrium.newton import newton
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.equilibrium.subspace import SmoothSubspace
from tympan.fem.film.laws import NeoHooke
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Settings, build_model

SOFT, FORCE = 15e3, 17.9e-3 * G


def reference() -> Film:
    """The film of 15 kPa."""
    return oracle(neo_hooke(SOFT))


def soft_model() -> Model:
    """The same in finite elements, at the default mesh, bearing compression."""
    return replace(build_model(annulus(NeoHooke(SOFT)), Settings()), wrinkles=False)


def beyond() -> Outcome:
    """How the search for an equilibrium at 7 kV ends: there is none."""
    outcome = equilibrium(soft_model(), FORCE, 7000.0)
    if outcome.limit is None:
        raise ArithmeticError(f"no limit was found: {outcome.advice}")
    return outcome


@claim("Pull-in voltage, neo-Hooke 15 kPa, ε_r 4.7, 17.9 g, by arc length", tolerance=1e-5,
       reference="axisymmetric equations, fold of the Ritz branch; a membrane that cannot wrinkle")
def pull_in() -> Iterator[Pair]:
    """The largest voltage with an equilibrium of the membrane; the branch beyond follows below."""
    outcome = beyond()
    yield Pair("U", math.sqrt(outcome.limit or 0.0), pull_in_voltage(reference(), FORCE), "V")


@claim("The unstable branch beyond pull-in: voltage at its deflections",
       reference="axisymmetric equations, Ritz branch followed in the deflection; "
                 "a membrane that cannot wrinkle",
       tolerance=1e-3)
def unstable_branch() -> Iterator[Pair]:
    """From 6.4 kV over the fold at 9.77 mm to 11 mm, near where the deflection turns back too."""
    model = soft_model()
    start = equilibrium(model, FORCE, 6400.0).state
    branch = Branch(model, "voltage", subspace=SmoothSubspace.of(model, waves=0))
    for point in branch.points(start):
        heave = point.state.plate.deflection
        if heave > 11e-3:
            return
        if heave > 9.8e-3:
            yield Pair(f"U at {heave * 1e3:.3f} mm", math.sqrt(point.state.voltage_squared),
                       branch_voltage(reference(), FORCE, heave), "V")


@claim("Voltage at which the same film, wrinkling, thins without bound", tolerance=5e-4,
       reference="axisymmetric equations: "
                 "hoop stress with its Maxwell part by the Ritz method is zero")
def thinning() -> Iterator[Pair]:
    """Relaxed, the film has no stable equilibrium beyond."""
    exact = slack_voltage(reference(), FORCE, 6700.0)
    for refine in (1.0, 2.0):
        mesh = Settings(MeshSettings().refined(refine))
        outcome = equilibrium(build_model(annulus(NeoHooke(SOFT)), mesh), FORCE, 7000.0)
        if not outcome.thins:
            raise ArithmeticError(outcome.advice)
        yield Pair(f"U, refined {refine:g} times", math.sqrt(outcome.limit or 0.0), exact, "V")


@claim("The loss of hoop tension by shooting", tolerance=1e-6,
       reference="Ritz method: the plate carries 17.9 g, the hoop stress is zero")
def loss_of_tension_by_shooting() -> Iterator[Pair]:
    """At the deflection and the voltage of the Ritz method."""
    film = reference()
    voltage = slack_voltage(film, FORCE, 6700.0)
    shot = shoot_deflection(film, solve_load(film, FORCE, voltage).deflection, voltage)
    yield Pair("F", shot.force, FORCE, "N")
    yield Pair("σ₂ over σ₁ at the plate", float(shot.total2(A) / shot.total1(A)), 0.0)


@claim("Force on a film mounted at 0.6 of its virgin size and partly wrinkled", tolerance=1e-3,
       reference="tension-field theory in the axisymmetric equations, by shooting, "
                 "natural width as a scalar root")
def wrinkled_film() -> Iterator[Pair]:
    """The program's film keeps a thousandth of its modulus as a tension across wrinkles."""
    heave, model = 90e-3, quarter_annulus(4, 4)
    film = replace(model.specimen.membrane, prestretch=(0.6, 0.6))
    model = replace(model, specimen=replace(model.specimen, membrane=film))
    cone = model.discretisation.reference.copy()
    cone[:, 2] = heave * (B - np.hypot(*cone.T[:2])) / (B - A)
    start = State(cone, model.mounted().plate.raised_to(heave))
    solution = newton(model, start, ("force",), (held_plate(heave),))
    if not solution.converged:
        raise ArithmeticError(solution.advice)
    exact = shoot_deflection(replace(oracle(neo_hooke(MU)), prestretch=0.6, relaxed=True), heave)
    yield Pair("F at 90 mm", solution.state.force, exact.force, "N")
