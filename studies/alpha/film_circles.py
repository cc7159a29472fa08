"""Circular actuators that stand for a shape.

Which radii, and the force of each at a deflection and a voltage.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize

from tympan.fem.equilibrium.ramp import held
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model
from tympan.geometry.errors import InputError
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Plate, Specimen
from tympan.studies.alpha.samples import Samples, frame_distances, parts_of
from tympan.studies.alpha.simplex import simplex_fit
from tympan.studies.case import Settings, build_model
from tympan.studies.circles.cone import ConeCircle, radii_of

Array = NDArray[np.float64]

#: Radii among which those of the fit are interpolated, and how far these go beyond the frame's
#: nearest and farthest.
_GRID, _BEYOND = 9, 1.1


@dataclass(frozen=True)
class Circles:
    """The membrane circles a specimen is compared with, on its rig's ``loading``."""

    specimen: Specimen
    settings: Settings
    loading: Loading

    def forces(self, radii: tuple[float, ...], samples: Samples) -> Array:
        """Force [N] of each circle at each sample's deflection and voltage, (samples, circles)."""
        return np.array([self._forces(radius, samples) for radius in radii]).reshape(len(radii),
                                                                                     -1).T

    def cones(self, radii: tuple[float, ...], samples: Samples) -> Array:
        """The same of straight cones (Eq. 5)."""
        cones = [ConeCircle(self.specimen, radius) for radius in radii]
        pairs = zip(samples.deflection, samples.voltage, strict=True)
        forces = np.array([[cone.force(y, u) for cone in cones] for y, u in pairs])
        return forces.reshape(-1, len(radii))

    def _forces(self, radius: float, samples: Samples) -> list[float]:
        model, column, start = self._model(radius), [], None
        for deflection, voltage in zip(samples.deflection, samples.voltage, strict=True):
            outcome = held(model, deflection, voltage, start, self.settings.path)
            start = outcome.solution if outcome.solution.converged else None
            if outcome.status != "equilibrium":
                raise InputError(f"a circle of radius {radius * 1e3:.4g} mm cannot follow its "
                                 "deflection",
                                 key="alpha", given=self.specimen.name)
            # The film's alone, as the samples have it: no spring.
            column.append(model.reaction(outcome.state))
        return column

    def _model(self, radius: float) -> Model:
        """The circular specimen of a radius with the same film, electrode and plate, centred."""
        try:
            circle = replace(self.specimen, name=f"circle {radius * 1e3:g} mm",
                             frame=Circle(radius),
                             plate=Plate(self.specimen.plate.outline))
        except InputError as error:
            raise InputError(f"has no circle of radius {radius * 1e3:g} mm to compare with: "
                             f"{error.allowed}",
                             key="alpha", given=self.specimen.name) from None
        return build_model(circle, self.settings, self.loading)


Chooser = Callable[[Circles, Samples, int], tuple[float, ...]]


def _semi_axes(circles: Circles, _: Samples, count: int) -> tuple[float, ...]:
    radii = radii_of(circles.specimen.frame)
    if len(radii) == 1:
        return radii
    return (float(np.sqrt(np.prod(radii))),) if count == 1 else _spread(radii[0], radii[-1], count)


def _sectors(circles: Circles, _: Samples, count: int) -> tuple[float, ...]:
    logarithm = np.log(frame_distances(circles.specimen))
    parts = parts_of(circles.specimen, count)
    return tuple(float(np.exp(logarithm[parts == part].mean())) for part in range(count))


def _fit(circles: Circles, samples: Samples, count: int) -> tuple[float, ...]:
    family = _Family.of(circles, samples)

    def misfit(logarithms: Array) -> float:
        forces = family.forces(logarithms)
        residual = forces @ simplex_fit(forces, samples.force) - samples.force
        apart = float(np.diff(np.sort(logarithms)).min(initial=np.inf))
        error = float(np.linalg.norm(residual) / np.linalg.norm(samples.force))
        return error + max(0.0, 0.02 - apart)

    start = np.log(_sectors(circles, samples, count))
    low, high = family.logarithms[[0, -1]]
    found = minimize(misfit, np.clip(start, low, high), method="Nelder-Mead",
                     bounds=[(low, high)] * count,
                     options={"xatol": 1e-5, "fatol": 1e-9})
    return tuple(float(radius) for radius in np.sort(np.exp(found.x)))


#: Ways to choose the circles' radii, shortest first: the frame's half extents along x and y and a
#: geometric series between them; parts of the directions around the plate, by the distance of the
#: frame, each with the geometric mean of its distances (a film's force goes with 1/ln(R/r)); or
#: those with which the forces fit best.
RADII: dict[str, Chooser] = {"semi_axes": _semi_axes, "sectors": _sectors, "fit": _fit}


@dataclass(frozen=True, eq=False)
class _Family:
    """Forces of circles of any radius in a range: a spline through some, in logarithms."""

    logarithms: Array
    values: Array

    @classmethod
    def of(cls, circles: Circles, samples: Samples) -> _Family:
        distance = frame_distances(circles.specimen)
        low, high = distance.min() / _BEYOND, distance.max() * _BEYOND
        low = max(low, 1.05 * max(circles.specimen.plate.outline.semi_axes))
        radii = _spread(low, max(high, 1.2 * low), _GRID)
        return cls(np.log(radii), circles.forces(radii, samples))

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.logarithms, np.log(self.values), axis=1)

    def forces(self, logarithms: Array) -> Array:
        """Shape (samples, circles)."""
        return np.asarray(np.exp(self._spline(logarithms)))


def _spread(low: float, high: float, count: int) -> tuple[float, ...]:
    return (low, *(float(radius) for radius in np.geomspace(low, high, count)[1:-1]), high)
