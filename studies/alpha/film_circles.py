"""Circular actuators that stand for a shape: their radii, and their forces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize

from tympan.fem.equilibrium.ramp import held
from tympan.fem.membrane.loading import Loading
from tympan.geometry.errors import InputError
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Plate, Specimen
from tympan.studies.alpha.samples import Samples, frame_distances, parts_of
from tympan.studies.alpha.simplex import simplex_fit
from tympan.studies.case import Settings, build_model
from tympan.studies.circles import ConeCircle, radii_of

Array = NDArray[np.float64]
Radii = tuple[float, ...]

#: Force [N] of circles of some radii at each sample's deflection and voltage, (samples, circles).
Forces = Callable[[Radii, Samples], Array]

#: Radii among which those of the fit are interpolated, and how far these go beyond the frame's
#: nearest and farthest.
_GRID, _BEYOND = 9, 1.1


def membrane_forces(specimen: Specimen, settings: Settings, loading: Loading, radii: Radii,
                    samples: Samples) -> Array:
    """Force [N] of membrane circles on a rig, shape (samples, circles).

    They have the specimen's film, electrode and plate, centred.
    """
    columns = []
    for radius in radii:
        size = f"{radius * 1e3:g} mm"
        try:
            circle = replace(specimen, name=f"circle {size}", frame=Circle(radius),
                             plate=Plate(specimen.plate.outline))
        except InputError as error:
            raise InputError(f"has no circle of radius {size} to compare with: {error.allowed}",
                             key="alpha", given=specimen.name) from None
        model, column, start = build_model(circle, settings, loading), [], None
        for deflection, voltage in zip(samples.deflection, samples.voltage, strict=True):
            outcome = held(model, deflection, voltage, start, settings.path)
            start = outcome.solution if outcome.solution.converged else None
            if outcome.status != "equilibrium":
                raise InputError(f"a circle of radius {radius * 1e3:.4g} mm cannot follow its "
                                 "deflection", key="alpha", given=specimen.name)
            # The film's alone, as the samples have it: no spring.
            column.append(model.reaction(outcome.state))
        columns.append(column)
    return np.array(columns).reshape(len(radii), -1).T


def cone_forces(specimen: Specimen, radii: Radii, samples: Samples) -> Array:
    """Force [N] of straight cones (Eq. 5), shape (samples, circles)."""
    cones = [ConeCircle(specimen, radius) for radius in radii]
    pairs = zip(samples.deflection, samples.voltage, strict=True)
    forces = np.array([[cone.force(y, u) for cone in cones] for y, u in pairs])
    return forces.reshape(-1, len(radii))


def _semi_axes(specimen: Specimen, count: int, forces: Forces, samples: Samples) -> Radii:
    radii = radii_of(specimen.frame)
    if len(radii) == 1:
        return radii
    return (float(np.sqrt(np.prod(radii))),) if count == 1 else _spread(radii[0], radii[-1], count)


def _sectors(specimen: Specimen, count: int, forces: Forces, samples: Samples) -> Radii:
    logarithm, parts = np.log(frame_distances(specimen)), parts_of(specimen, count)
    return tuple(float(np.exp(logarithm[parts == part].mean())) for part in range(count))


def _fit(specimen: Specimen, count: int, forces: Forces, samples: Samples) -> Radii:
    distance = frame_distances(specimen)
    low = max(distance.min() / _BEYOND, 1.05 * max(specimen.plate.outline.semi_axes))
    radii = _spread(low, max(distance.max() * _BEYOND, 1.2 * low), _GRID)
    logarithms = np.log(radii)
    spline = CubicSpline(logarithms, np.log(forces(radii, samples)), axis=1)

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


#: Ways to choose the circles' radii, shortest first: the frame's half extents along x and y and a
#: geometric series between them; parts of the directions around the plate, by the distance of the
#: frame, each with the geometric mean of its distances (a film's force goes with 1/ln(R/r)); or
#: those with which the forces fit best.
RADII: dict[str, Callable[[Specimen, int, Forces, Samples], Radii]] = {
    "semi_axes": _semi_axes, "sectors": _sectors, "fit": _fit}


def _spread(low: float, high: float, count: int) -> Radii:
    return (low, *(float(radius) for radius in np.geomspace(low, high, count)[1:-1]), high)
