"""Branches: limit points of every load, what lies beyond them, snap-through, and the critical mode.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import islice, pairwise
from typing import ClassVar

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.oracles import axisymmetric
from tests.oracles.axisymmetric import RitzExpansion, fold_point
from tests.oracles.unstable_branch import SOFT, WEIGHT, branch_points, voltage_at
from tests.support.models import pressed_model
from tests.support.specimens import circular, elliptical, reference_film
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.equilibrium.arc_length import ArcSettings, Branch
from tympan.fem.equilibrium.arc_segment import PathPoint
from tympan.fem.equilibrium.constraints import difference, length
from tympan.fem.equilibrium.newton import newton
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import LoadRamp
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.equilibrium.subspace import SmoothSubspace
from tympan.fem.film.laws import Ogden
from tympan.fem.film.library import MATERIALS
from tympan.fem.membrane.biases import Magnet
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE, State
from tympan.geometry.mesh import unfold
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Plate
from tympan.studies.shipped import actuators

VHB = Ogden((18.4e3, 210.0), (2.0, 4.0))


def limits(branch: Branch, start: State, count: int) -> list[PathPoint]:
    """The first limit points of a branch."""
    points = []
    for before, after in pairwise(branch.points(start)):
        if before.rate * after.rate < 0:
            limit = branch.where(before, after, lambda point: point.rate)
            assert limit is not None
            points.append(limit)
        if len(points) == count:
            break
    return points


@pytest.mark.parametrize(("material", "mass"), [(SOFT, 17.9e-3), (VHB, 17.9e-3), (VHB, 100e-3)])
def test_pull_in_voltage_is_the_ode_s(material: Ogden, mass: float) -> None:
    force = mass * 9.80665
    film = pressed_model(circular(material))
    outcome = equilibrium(film, force, 9000.0)
    assert outcome.status == "no_equilibrium"
    exact = axisymmetric.pull_in(reference_film(material), force)
    assert np.sqrt(outcome.limit) == pytest.approx(exact.voltage, rel=1e-5)
    # At the maximum the heave is known only as well as the root of the voltage.
    assert outcome.critical.state.plate.deflection == pytest.approx(exact.deflection, rel=2e-3)


def test_unstable_branch_is_the_ode_s() -> None:
    film = pressed_model(circular(SOFT))
    points = branch_points(film, SmoothSubspace.of(film, 0), longest=6e-3)
    fold = fold_point(RitzExpansion(reference_film(SOFT), 40), WEIGHT)
    near, checked = (fold.c, fold.q), 0
    for point in points:
        heave = point.state.plate.deflection
        if heave <= fold.deflection:
            continue
        near = voltage_at(reference_film(SOFT), heave, WEIGHT, near, 40)
        assert np.sqrt(point.state.voltage_squared) == pytest.approx(np.sqrt(near[1]), rel=1e-3)
        assert point.rate < 0
        assert point.solution.tangent.negative == 1
        assert not point.solution.stable
        checked += 1
    assert checked >= 4
    assert heave > fold.deflection + 0.8e-3


def test_critical_mode_is_the_branch_s_derivative() -> None:
    film = pressed_model(circular(SOFT))
    outcome = equilibrium(film, WEIGHT, 7000.0)
    mode = outcome.critical.direction
    assert length(film, mode) == pytest.approx(1, rel=1e-12)
    branch = Branch(film, "voltage", subspace=SmoothSubspace.of(film, 0))
    step = 1e-3
    ahead, back = (branch.at(outcome.critical, change) for change in (step, -step))
    moved = difference(film, ahead.state, back.state)
    scale = max(np.abs(mode[0]).max(), np.abs(mode[1]).max())
    for part, change in zip(mode, moved, strict=True):
        assert np.allclose(part, change / (2 * step), rtol=0, atol=1e-3 * scale)
    # The plate's heave is the largest motion, and at the fold the tangent does not resist the mode.
    assert abs(mode[1][film.plate_freedoms.index(HEAVE)]) == scale
    part = film.linearised(outcome.critical.state)
    resisted = mode[0] @ (part.inner @ mode[0]) + 2 * mode[0] @ (part.border @ mode[1]) \
        + mode[1] @ part.corner @ mode[1]
    stiff = part.corner[0, 0] * mode[1][0] ** 2
    assert abs(resisted) < 1e-4 * stiff


@pytest.mark.study(seconds=5)
def test_an_ellipse_s_pull_in_settles() -> None:
    """With the mesh, with the waves that smooth motions may have, and alike on quarter and whole.
    """
    specimen = elliptical(60e-3, SOFT)

    def limit(film: Model, waves: int = 4) -> float:
        outcome = equilibrium(film, WEIGHT, 12e3, settings=PathSettings(smooth=((waves, 14),)))
        assert outcome.status == "no_equilibrium"
        return float(np.sqrt(outcome.limit))

    quarter = pressed_model(specimen)
    usual = limit(quarter)
    assert limit(quarter, 6) == pytest.approx(usual, rel=1e-3)
    assert limit(pressed_model(specimen, refine=1.5)) == pytest.approx(usual, rel=1e-3)
    part = quarter.discretisation
    whole_film = Model(Discretisation.of(unfold(part.mesh, part.planes)[0]), specimen,
                       wrinkles=False)
    assert limit(whole_film) == pytest.approx(usual, rel=1e-5)


@pytest.mark.study(seconds=6)
def test_a_limit_is_found_on_any_mesh() -> None:
    """Beside it, a point that was beyond it by the tangent of an iterate was before it by its own.
    """
    specimen = replace(elliptical(70e-3, MATERIALS["vhb-4910"].material),
                       plate=Plate(Ellipse((12e-3, 9e-3)), (4e-3, 0.0)))
    outcomes = [equilibrium(pressed_model(specimen, refine=refine), 17.9e-3 * 9.81, 20e3)
                for refine in (1.0, 1.2, 1.3)]
    assert not any(outcome.thins for outcome in outcomes)
    limits = [np.sqrt(outcome.limit) for outcome in outcomes]
    assert np.ptp(limits) < 1e-5 * limits[-1]


def test_a_limit_is_looked_for_from_both_sides() -> None:
    """Newton's method went astray from the nearest point, and the limit between two was missed."""
    specimen = replace(actuators()[-1], frame=Ellipse((58.0951e-3, 58.0944e-3)),
                       plate=Plate(Circle(6.3438e-3)))
    film, weight = pressed_model(specimen), 17.9e-3 * 9.80665
    charged = equilibrium(film, weight, 6500.0)

    def limit(waves: int, degree: int) -> float:
        settings = PathSettings(smooth=((waves, degree),))
        outcome = equilibrium(film, weight, 11.7e3, start=charged.solution, settings=settings)
        assert outcome.limit is not None
        return float(np.sqrt(outcome.limit))

    assert limit(4, 14) == pytest.approx(limit(4, 10), rel=1e-4)


def test_a_limit_in_force() -> None:
    """A soft film's force–heave curve at a voltage has a maximum: found by force, by arc and in the
    ODE's curve."""
    film, voltage = pressed_model(circular(SOFT)), 6700.0
    by_ramp = equilibrium(film, 1.0, 0.0)
    assert by_ramp.status == "equilibrium"
    start = equilibrium(film, 0.05, voltage).state
    smooth = SmoothSubspace.of(film, 0)
    limit = limits(Branch(film, "force", subspace=smooth), start, 1)[0]
    exact = axisymmetric.pull_in(reference_film(SOFT), limit.state.force)
    assert exact.voltage == pytest.approx(voltage, rel=1e-5)


def test_a_branch_comes_back_on_itself() -> None:
    film = pressed_model(circular(SOFT))
    branch = Branch(film, "voltage", arc=ArcSettings(longest=0.02))
    start = equilibrium(film, WEIGHT, 3000.0).state
    ahead = list(islice(branch.points(start), 6))
    assert all(point.rate > 0 for point in ahead)
    back = []
    for point in branch.points(ahead[-1].state, -1):
        back.append(point)
        if point.state.voltage_squared < start.voltage_squared:
            break
    assert all(before.state.voltage_squared > after.state.voltage_squared
               for before, after in pairwise(back))
    again = branch.where(back[-2], back[-1],
                         lambda point: point.state.voltage_squared - start.voltage_squared)
    assert np.allclose(again.state.positions, start.positions, atol=1e-7)
    assert again.rate == pytest.approx(-ahead[0].rate, rel=1e-3)


@dataclass(frozen=True)
class Stop:
    """A soft stop below the plate: a push that grows with the square of the heave beyond ``start``.
    """

    start: float
    stiffness: float
    softening: ClassVar[tuple[tuple[float, float], ...]] = ()

    def derivatives(self, heave: float) -> tuple[float, float, float]:
        """Energy, force, stiffness."""
        beyond = max(heave - self.start, 0.0)
        return (self.stiffness * beyond**3 / 3,
                self.stiffness * beyond**2,
                2 * self.stiffness * beyond)


MAGNET, STOP, LIGHT = Magnet(0.8, 6e-3, 5e-3), Stop(4e-3, 1e6), 0.07


def total(heave: float, voltage: float) -> tuple[float, float]:
    """Force of film, magnet and stop at a heave and its slope: the ODE, and both mechanisms written
    out again."""
    film = axisymmetric.solve_deflection(reference_film(VHB), heave, voltage)
    near, beyond = 1 + (6e-3 - heave) / 5e-3, max(heave - 4e-3, 0.0)
    return (film.force - 0.8 * near**-4 + 1e6 * beyond**2,
            film.stiffness - 0.8 * 4 / 5e-3 * near**-5 + 2e6 * beyond)


def extremum(within: tuple[float, float]) -> tuple[float, float]:
    """Heave and voltage where the force of everything is stationary in the heave and equals the
    weight."""
    def heave(voltage: float) -> float:
        return float(brentq(lambda w: total(w, voltage)[1], *within, xtol=1e-11))

    voltage = float(brentq(lambda u: total(heave(u), u)[0] - LIGHT, 2000.0, 5500.0, xtol=1e-4))
    return heave(voltage), voltage


def test_a_magnet_snaps_the_plate_through_and_back() -> None:
    """S-shaped branch in voltage: two limit points where the force of everything is stationary,
    unstable between."""
    film = replace(pressed_model(circular(VHB)), loading=Loading((MAGNET, STOP)))
    start = equilibrium(film, LIGHT, 0.0).state
    points, turns = [], []
    branch = Branch(film, "voltage", arc=ArcSettings(longest=5e-3))
    for point in branch.points(start):
        points.append(point)
        if len(points) > 1 and points[-2].rate * point.rate < 0:
            turns.append(branch.where(points[-2], point, lambda point: point.rate))
        if len(turns) == 2 and point.state.voltage_squared > 5500.0**2:
            break
    up, down = (turn.state for turn in turns)
    for turn, within in ((up, (1e-3, 3.9e-3)), (down, (3.9e-3, 4.8e-3))):
        heave, voltage = extremum(within)
        assert np.sqrt(turn.voltage_squared) == pytest.approx(voltage, rel=1e-5)
        assert turn.plate.deflection == pytest.approx(heave, rel=1e-3)
    for point in points:
        between = up.plate.deflection < point.state.plate.deflection < down.plate.deflection
        tangent = point.solution.tangent
        assert tangent.negative == int(between)
        # Compliance of the plate's heave, everything else following.
        compliance = np.linalg.inv(tangent.plate_stiffness)
        heave = film.plate_freedoms.index(HEAVE)
        assert (compliance[heave, heave] < 0) == between
        assert (point.rate < 0) == between
        assert point.solution.stable != between
    assert sum(point.rate < 0 for point in points) >= 2


def test_between_two_branches_the_last_point_of_the_first_is_given() -> None:
    """Under another weight the film is on another branch: it is never under a weight between."""
    film = pressed_model(circular(VHB))
    branch, other = (list(islice(Branch(film, "voltage").points(
        equilibrium(film, weight, 0.0).state), 3)) for weight in (LIGHT, 1.2 * LIGHT))

    def heavier(point: PathPoint) -> float:
        return point.state.force - 1.1 * LIGHT

    assert heavier(branch[1]) < 0 < heavier(other[2])
    last = Branch(film, "voltage").where(branch[1], other[2], heavier, needs="state")
    assert last is not None
    assert last.state.force == LIGHT
    assert last.state.plate.deflection > branch[1].state.plate.deflection

    def deeper(point: PathPoint) -> float:
        deep = (branch[1].state.plate.deflection + branch[2].state.plate.deflection) / 2
        return point.state.plate.deflection - deep

    assert Branch(film, "voltage").where(branch[1], branch[2], deeper, needs="state") is not None


def test_hysteresis_of_a_magnet() -> None:
    """Between the limits the state remembers; above the upper one the plate has snapped through,
    and a ramp says where; below the lower one it has snapped back."""
    film = replace(pressed_model(circular(VHB)), loading=Loading((MAGNET, STOP)))
    (near, snap), (far, back) = extremum((1e-3, 3.9e-3)), extremum((3.9e-3, 4.8e-3))
    middle = (snap + back) / 2
    rising = equilibrium(film, LIGHT, middle)
    assert rising.state.plate.deflection < near
    assert not rising.snapped
    # However far the target, the ramp does not step over the snap to the state beyond.
    for volts in (1.01 * snap, 4600.0, 5000.0, 7000.0):
        ended = LoadRamp(film, "voltage", volts**2).run(rising.solution)
        assert (ended.status, ended.limited) == ("no_equilibrium", "voltage")
        assert np.sqrt(ended.limit) == pytest.approx(snap, rel=1e-5)
        snapped = equilibrium(film, LIGHT, volts)
        assert (snapped.status, snapped.snapped) == ("equilibrium", True)
        heave = snapped.state.plate.deflection
        assert heave > far
        assert total(heave, volts)[0] == pytest.approx(LIGHT, rel=1e-5)
    beyond = held(film, 1.15 * far, 1.01 * snap)
    fallen = newton(film, beyond.state.under(force=LIGHT))
    assert fallen.converged
    returning = equilibrium(film, LIGHT, middle, start=fallen)
    assert returning.status == "equilibrium"
    assert returning.state.plate.deflection > far
    ended = LoadRamp(film, "voltage", (0.98 * back) ** 2).run(fallen)
    assert (ended.status, ended.limited) == ("no_equilibrium", "voltage")
    assert np.sqrt(ended.limit) == pytest.approx(back, rel=1e-5)
    released = equilibrium(film, LIGHT, 0.98 * back, start=fallen)
    assert (released.status, released.snapped) == ("equilibrium", True)
    assert released.state.plate.deflection < near
