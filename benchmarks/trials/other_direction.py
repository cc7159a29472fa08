"""The same case reached from another direction: voltage first, the plate held at heaves, or the
axisymmetric equations.

Each check returns a :class:`Verdict`. "agrees" and "differs" are about the status and the numbers
of the outcome; "silent" means that this direction says nothing about the case.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from benchmarks.trials.random_specimens import Drawn
from tests.oracles import axisymmetric
from tests.oracles.laws import SAMPLES
from tests.oracles.unstable import end_voltage
from tympan.fem.equilibrium.constraints import held_plate
from tympan.fem.equilibrium.newton import moved, newton
from tympan.fem.equilibrium.ramp import LoadRamp, Outcome
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.equilibrium.subspace import FULL
from tympan.fem.film.laws import Ogden
from tympan.fem.membrane.model import Model
from tympan.geometry.specimen import Material

#: Largest difference of heaves and of loads at the limit, relative; the oracle's also has the
#: coarse mesh's error.
SAME, LIKE_ORACLE = 1e-4, 5e-3


@dataclass(frozen=True)
class Verdict:
    """What another direction says, and the largest relative difference of the numbers compared."""

    way: str
    says: Literal["agrees", "differs", "silent"]
    error: float = 0.0
    words: str = ""


def voltage_first(model: Model, drawn: Drawn, solved: Outcome) -> Verdict:
    """The film charged while flat, then the gas, then the weight."""
    way, case = "voltage first", drawn.case
    outcome = equilibrium(model, 0.0, case.rig.film_voltage(case.voltage))
    if outcome.status != "equilibrium" and solved.status == "equilibrium":
        return Verdict(way, "silent",
                       words="without its load the film has no equilibrium at this voltage")
    for load, value in (("pressure", case.rig.gas_pressure),
                        ("force", case.rig.force(case.mass, model.plate_area))):
        if outcome.status == "equilibrium":
            outcome = LoadRamp(model, load, value).run(outcome.solution)
    if outcome.status == "not_converged":
        return Verdict(way, "silent", words=outcome.advice)
    if outcome.status != solved.status:
        ends = (1e3 * end.state.plate.deflection for end in (outcome, solved))
        heave = "heave {:.3f} mm, found {:.3f} mm".format(*ends)
        return Verdict(way, "differs", words=f"{outcome.status} instead: {heave}")
    if solved.status == "no_equilibrium":
        return Verdict(way, "agrees")
    heaves = outcome.state.plate.deflection, solved.state.plate.deflection
    error = abs(heaves[0] - heaves[1]) / max(abs(heaves[1]), 1e-3 * model.size)
    return Verdict(way, "agrees" if error < SAME else "differs", error,
                   "heaves {:.4g}, {:.4g} m".format(*heaves))


def along_heaves(model: Model, drawn: Drawn, solved: Outcome) -> Verdict:
    """The load that keeps the plate at one heave after another, from where that load is zero to
    beyond the limit.

    The heave takes the place of the load as what is given, so that the limit point is nothing
    special there.
    """
    way, critical, load = "deflection by deflection", solved.critical, solved.limited
    assert critical is not None
    assert load is not None
    if not solved.advice.startswith("the film pulls in"):
        return Verdict(way, "silent", words=solved.advice)
    subspace = critical.solution.tangent.subspace if critical.solution.tangent else FULL
    rig = drawn.case.rig
    force = rig.force(drawn.case.mass, model.plate_area) if load != "force" else 0.0
    at = equilibrium(model, force, 0.0, rig.gas_pressure if load == "voltage" else 0.0).solution
    first, last = at.state.plate.deflection, critical.state.plate.deflection
    if not abs(last - first) > 0.01 * model.size:
        return Verdict(way, "silent", words="the plate hardly moves")
    at = newton(model, at.state, (load,), (held_plate(first),), subspace=subspace)
    points = [(first, at.state.load(load))]
    for heave in first + (last - first) * np.linspace(0.04, 1.2, 30):
        if not at.converged or at.tangent is None:
            break
        change = heave - at.state.plate.deflection
        motion, loads = at.tangent.along()
        at = newton(model, moved(model, at.state, motion, change, loads), (load,),
                    (held_plate(float(heave)),),
                    subspace=subspace)
        if at.converged:
            points.append((float(heave), at.state.load(load)))
    return _compared(way, points, solved, "" if subspace is FULL else "smooth")


def _compared(way: str, points: list[tuple[float, float]], solved: Outcome, words: str) -> Verdict:
    if len(points) < 5:
        return Verdict(way, "silent", words=f"only {len(points)} heaves converged")
    heaves, loads = np.array(points).T
    top = int(np.argmax(loads))
    if top == len(loads) - 1 and len(loads) < 31:
        return Verdict(way, "silent",
                       words=f"the heaves could be followed only to the {top}th of 30")
    if not 0 < top < len(loads) - 1:
        return Verdict(way, "differs", words=f"the load is largest at the {top}th of 30 heaves")
    near = slice(max(0, top - 2), top + 3)
    offset = (heaves[near] - heaves[top]) / np.ptp(heaves)
    curve = np.poly1d(np.polyfit(offset, loads[near], min(4, len(offset) - 1)))
    peak = max(float(curve(x)) for x in np.linspace(offset[0], offset[-1], 801))
    error = abs(peak / solved.limit - 1) if solved.limit else np.inf
    return Verdict(way, "agrees" if error < 1e-3 else "differs", error, words)


def oracle(model: Model, drawn: Drawn, solved: Outcome) -> Verdict:
    """The axisymmetric equations: deflection of an equilibrium, voltage at the end."""
    way, case, film = "axisymmetric equations", drawn.case, drawn.case.specimen.membrane
    law = _reference(film.material)
    if not drawn.plain or law is None:
        return Verdict(way, "silent")
    reference = axisymmetric.Film(
        case.specimen.plate.outline.semi_axes[0], case.specimen.frame.semi_axes[0], film.thickness,
        film.prestretch[0], law, film.relative_permittivity, film.permittivity_exponent)
    force = case.rig.force(case.mass, model.plate_area)
    limit = end_voltage(reference, force, case.voltage)
    if np.isnan(limit):
        return Verdict(way, "silent", words="the film goes on wrinkled")
    words = f"the end at {limit:.5g} V"
    if solved.status == "no_equilibrium":
        error = abs(np.sqrt(solved.limit or 0) / limit - 1) if np.isfinite(limit) else np.inf
        return Verdict(way, "agrees" if error < LIKE_ORACLE and limit < case.voltage else "differs",
                       error, words)
    if limit < case.voltage:
        return Verdict(way, "differs", words=f"{words}, asked for {case.voltage:.5g} V")
    try:
        exact = axisymmetric.solve_load(reference, force, case.voltage).deflection
    except ArithmeticError as failure:
        return Verdict(way, "silent", words=str(failure))
    error = abs(solved.state.plate.deflection - exact) / max(exact, 1e-3 * model.size)
    return Verdict(way, "agrees" if error < LIKE_ORACLE else "differs", error, words)


def _reference(material: Material) -> axisymmetric.Material | None:
    """An implementation of a law that shares nothing with tympan.fem.film.laws, where there is one.
    """
    if isinstance(material, Ogden):
        return axisymmetric.Ogden(material.mu, material.alpha)
    return next((sample.reference for sample in SAMPLES.values() if sample.law == material), None)
