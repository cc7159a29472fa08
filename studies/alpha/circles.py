"""Circular actuators equivalent to a shape: loads of the comparison, radii and forces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.solve import held
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import edge_fields
from tympan.fem.rig import Rig
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Plate, Specimen
from tympan.studies.alpha.simplex import simplex_fit
from tympan.studies.case import Settings, build_model, failure_reason, voltage_ramp
from tympan.studies.circles import ConeCircle, radii_of
from tympan.studies.limits.loads import LoadGrid

Radii = tuple[float, ...]

#: Deflection of a plate that has not moved, over the mesh's size: its force carries no information.
STILL_PLATE = 1e-6

#: Number of directions around the plate.
_DIRECTIONS = 7200

#: Gas pressure that deforms nothing, over the film's force on the area of the plate.
_LITTLE = 1e-3

#: Number of radii at which forces are solved for the fit, a cubic spline between. Set by trial.
_GRID = 9
#: Factor by which the radii of the fit go beyond the frame's nearest and farthest distance, so that
#: the best radius lies inside.
_BEYOND = 1.1


@dataclass(frozen=True, eq=False)
class Samples:
    """Equilibria: force on the film [N], deflection [m], film voltage [V], shares (n, parts).

    Force and shares are those of the film without gas, at the deflection that it has with gas;
    ``lift`` [N] is the force added by the gas below film and plate.
    """

    force: Array
    deflection: Array
    voltage: Array
    shares: Array
    lift: Array

    def __len__(self) -> int:
        return len(self.force)


#: Force [N] of circles of given radii at each sample's deflection and voltage, (samples, circles).
Forces = Callable[[Radii, Samples], Array]


def equilibria(model: Model, loads: LoadGrid, rig: Rig, settings: Settings, parts: int,
               warnings: list[str]) -> Samples:
    """Solve a model under every load that has an equilibrium; ``warnings`` names the others."""
    part_of = parts_of(model.specimen, parts)
    rows: list[tuple[float, float, float, float]] = []
    shares: list[Array] = []
    for mass in loads.masses:
        for _, outcome in voltage_ramp(model, mass, loads.voltages, rig, settings.path):
            state = outcome.state
            if outcome.status != "equilibrium":
                warnings.append(f"{mass * 1e3:g} g: {failure_reason(outcome)}; loads beyond are "
                                "left out")
                break
            if abs(state.plate.deflection) <= STILL_PLATE * model.size:
                warnings.append(f"{mass * 1e3:g} g: the plate hardly moves; this load is left out")
                break
            plate, volts = state.plate, float(np.sqrt(state.voltage_squared))
            alone = state
            if rig.gas_pressure:
                alone = _held(model, plate.deflection, volts, settings, None).state
            pull = model.reaction(alone)
            lifted = rig.gas_pressure * model.plate_area + model.reaction(state) - pull
            rows.append((pull, plate.deflection, volts, lifted))
            shares.append(part_shares(model, alone, part_of))
    force, deflection, voltage, lift = np.array(rows).reshape(-1, 4).T
    return Samples(force, deflection, voltage, np.array(shares).reshape(-1, parts), lift)


def gas_area(model: Model, samples: Samples, rig: Rig, settings: Settings
             ) -> float | None:
    """Compute the area [m²] on which a gas below film and plate lifts the plate.

    On a rig without gas it is that of the first sample, with so little gas that it deforms nothing.
    None for a film whose volume is not known.
    """
    if not model.bears_gas:
        return None
    if rig.gas_pressure:
        return float(samples.lift.mean() / rig.gas_pressure)
    pull, deflection, voltage = (float(each[0]) for each in (
        samples.force, samples.deflection, samples.voltage))
    pressure = _LITTLE * abs(pull) / model.plate_area
    above = _held(model, deflection, voltage, settings, None, pressure)
    return float(model.plate_area + (model.reaction(above.state) - pull) / pressure)


def _held(model: Model, deflection: float, voltage: float, settings: Settings,
          start: Solution | None, gas_pressure: float = 0.0) -> Solution:
    """Solve a film with its plate at a deflection [m] under a film voltage [V].

    Raises
    ------
    InputError
        When the film cannot follow.
    """
    outcome = held(model, deflection, voltage, start, settings.path, gas_pressure)
    if outcome.status != "equilibrium":
        settings.path.require_work(model.specimen.name)
        raise InputError("cannot follow its deflection", key="alpha", given=model.specimen.name)
    return outcome.solution


def frame_distances(specimen: Specimen) -> Array:
    """Measure the distance from the plate's centre to the frame [m] in equal directions."""
    x, y = specimen.frame.points(2 * _DIRECTIONS) - np.array(specimen.centre)[:, None]
    angle = np.arctan2(y, x) % (2 * np.pi)
    order = np.argsort(angle)
    distance = np.hypot(x, y)[order]
    directions = 2 * np.pi * (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    return np.asarray(np.interp(directions, angle[order], distance, period=2 * np.pi))


def parts_of(specimen: Specimen, count: int) -> Numbers:
    """Assign each direction to one of ``count`` parts of equal angle, 0 nearest to the frame.

    An ellipse's two parts are the sectors within 45° of its short and of its long axis.
    """
    # Rounding keeps mirror images of a direction, equal but for the last bit, together.
    distance = frame_distances(specimen).round(12)
    rank = np.argsort(np.argsort(distance, kind="stable"), kind="stable")
    return np.asarray(rank * count // len(rank), dtype=np.int64)


def concentric(specimen: Specimen) -> bool:
    """Check whether the frame is equally far from the plate's centre in all directions."""
    distance = frame_distances(specimen)
    return bool(np.ptp(distance) < 1e-6 * distance.max())


def part_shares(model: Model, state: State, part_of: Numbers) -> Array:
    """Compute shares of the plate's vertical edge force in the parts of :func:`parts_of`.

    The force is the integral of the first Piola traction along the mounted edge; angles are those
    of the mounted edge around the plate's centre.
    """
    parts = 1 + int(part_of.max())
    if parts == 1:
        return np.ones(1)
    fields, weights = edge_fields(model, state, "plate", 24, quadrature=True)
    arm = fields.position - model.centre
    angle = np.arctan2(arm[:, 1], arm[:, 0]) % (2 * np.pi)
    order = np.argsort(angle)
    force = (fields.plate_traction[:, 2] * weights)[order]
    # The midpoint rule on the cumulative force lets a part end between two points of an edge.
    cumulative, total = np.cumsum(force) - force / 2, force.sum()
    around, turn = angle[order], 2 * np.pi
    angles = np.concatenate([around - turn, around, around + turn])
    sums = np.concatenate([cumulative - total, cumulative, cumulative + total])
    ends = np.interp(turn * np.arange(_DIRECTIONS + 1) / _DIRECTIONS, angles, sums)
    return np.asarray(np.bincount(part_of, np.diff(ends), parts) / total)


def membrane_forces(specimen: Specimen, settings: Settings, rig: Rig, radii: Radii,
                    samples: Samples) -> Array:
    """Compute the force [N] of centred membrane circles with the specimen's film and plate.

    The electrode is the specimen's, too; there is no gas. Shape (samples, circles).
    """
    columns = []
    for radius in radii:
        size = f"{radius * 1e3:g} mm"
        try:
            circle = replace(specimen, name=f"circle {size}", frame=Circle(radius),
                             plate=Plate(specimen.needed_plate().outline))
        except InputError as error:
            raise InputError(f"has no circle of radius {size} to compare with: {error.allowed}",
                             key="alpha", given=specimen.name) from None
        model, column, start = build_model(circle, settings, rig.loading), [], None
        for deflection, voltage in zip(samples.deflection, samples.voltage, strict=True):
            start = _held(model, deflection, voltage, settings, start)
            # The force is the film's alone, as in the samples, without a spring.
            column.append(model.reaction(start.state))
        columns.append(column)
    return np.array(columns).reshape(len(radii), -1).T


def cone_forces(specimen: Specimen, radii: Radii, samples: Samples) -> Array:
    """Compute the force [N] of straight cones (Eq. 5), shape (samples, circles)."""
    cones = ConeCircle(specimen, np.array(radii))
    pairs = zip(samples.deflection, samples.voltage, strict=True)
    return np.array([cones.force(y, u) for y, u in pairs]).reshape(-1, len(radii))


def _semi_axes(specimen: Specimen, count: int, forces: Forces, samples: Samples) -> Radii:
    radii = radii_of(specimen.frame)
    if len(radii) == 1:
        return radii
    if count == 1:
        return (float(np.sqrt(np.prod(radii))),)
    return tuple(np.geomspace(radii[0], radii[-1], count).tolist())


def _sectors(specimen: Specimen, count: int, forces: Forces, samples: Samples) -> Radii:
    logarithm, parts = np.log(frame_distances(specimen)), parts_of(specimen, count)
    return tuple(float(np.exp(logarithm[parts == part].mean())) for part in range(count))


def _fit(specimen: Specimen, count: int, forces: Forces, samples: Samples) -> Radii:
    distance = frame_distances(specimen)
    low = max(distance.min() / _BEYOND, 1.05 * max(specimen.needed_plate().outline.semi_axes))
    radii = np.geomspace(low, max(distance.max() * _BEYOND, 1.2 * low), _GRID)
    logarithms = np.log(radii)
    spline = CubicSpline(logarithms, np.log(forces(tuple(radii.tolist()), samples)), axis=1)

    def misfit(logarithms: Array) -> float:
        force = np.asarray(np.exp(spline(logarithms)))
        residual = force @ simplex_fit(force, samples.force) - samples.force
        apart = np.diff(np.sort(logarithms)).min(initial=np.inf)
        error = float(np.linalg.norm(residual) / np.linalg.norm(samples.force))
        return error + max(0.0, 0.02 - float(apart))

    start = np.log(_sectors(specimen, count, forces, samples))
    ends = logarithms[[0, -1]]
    best = minimize(misfit, np.clip(start, *ends), method="Nelder-Mead", bounds=[ends] * count,
                    options={"xatol": 1e-5, "fatol": 1e-9})
    return tuple(float(radius) for radius in np.sort(np.exp(best.x)))


#: Rules for the circles' radii, shortest first. They are: the frame's half extents along x and y
#: with a geometric series between; parts of the directions around the plate, by the distance of the
#: frame, each with the geometric mean of its distances (a film's force goes with 1/ln(R/r)); or
#: those with which the forces fit best.
RADII: dict[str, Callable[[Specimen, int, Forces, Samples], Radii]] = {
    "semi_axes": _semi_axes, "sectors": _sectors, "fit": _fit}
