"""What a mode is, in words, as far as numbers bear it out."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import FREEDOMS
from tympan.fem.vibration.modes import Modes

Array = NDArray[np.float64]

#: Plate freedoms that may mix, as numbers in FREEDOMS, and their names: together, and one of them
#: alone.
_MOTIONS = (((0, 1), "slide", "slide along {}"), ((2,), "heave", "heave"),
            ((3, 4), "tilt", "tilt about {}"), ((5,), "twist", "twist"))
_MAINLY = 0.9  #: share from which a name says what a mode is
_ORDERS = 12  #: angular orders looked for
_DEGREE = 11  #: of the radial polynomial: resolves five nodal circles and more
_LEAST = 0.02  #: share of the largest amplitude below which a swing is not counted as a sign


def mode_names(model: Model, modes: Modes) -> tuple[str, ...]:
    """A name for each mode; the model is that of the whole film.

    ``heave``, ``tilt about x``, ``slide along y`` or ``twist`` when the plate carries more than
    half of the kinetic energy, most of it in that freedom. Otherwise ``film``; with ``(m, n)`` for
    m nodal diameters and n nodal circles between the edges when frame, plate and prestretch are
    round and nine tenths of the displacement along the load follow such a pattern; and ``film, in
    plane`` when the film moves across the load.
    """
    return tuple(_plate_name(share) or _film_name(model, shape)
                 for share, shape in zip(modes.shares, modes.shapes, strict=True))


def _plate_name(share: Array) -> str:
    if share.sum() <= 0.5:
        return ""
    totals = [share[list(numbers)].sum() for numbers, _, _ in _MOTIONS]
    numbers, together, alone = _MOTIONS[int(np.argmax(totals))]
    if max(totals) <= 0.5 * share.sum():
        return "plate"
    main = max(numbers, key=lambda number: float(share[number]))
    return alone.format(FREEDOMS[main][-1]) if share[main] > _MAINLY * max(totals) else together


def _film_name(model: Model, shape: Array) -> str:
    across, along = (shape[:, :2] ** 2).sum(), (shape[:, 2] ** 2).sum()
    if along < (1 - _MAINLY) * (across + along):
        return "film, in plane"
    if along > _MAINLY * (across + along) and model.specimen.axisymmetric:
        pattern = _pattern(model.discretisation.reference[:, :2], shape[:, 2])
        if pattern is not None:
            return "film ({}, {})".format(*pattern)
    return "film"


def _pattern(points: Array, height: Array) -> tuple[int, int] | None:
    """Nodal diameters and circles of w = P(r) cos mθ + Q(r) sin mθ, or None if that fits badly."""
    radius, angle = np.hypot(*points.T), np.arctan2(*points.T[::-1])
    s = 2 * (radius - radius.min()) / np.ptp(radius) - 1
    radial = chebyshev.chebvander(s, _DEGREE)
    for order in range(_ORDERS + 1):
        parts = [radial * np.cos(order * angle)[:, None], radial * np.sin(order * angle)[:, None]]
        design = np.hstack(parts[: 2 if order else 1])
        coefficients = np.linalg.lstsq(design, height, rcond=None)[0]
        if np.sum((height - design @ coefficients) ** 2) < (1 - _MAINLY) * np.sum(height**2):
            profiles = coefficients.reshape(-1, _DEGREE + 1)
            leading = profiles.T @ np.linalg.svd(profiles)[0][:, 0]
            profile = chebyshev.chebval(np.linspace(-1, 1, 400), leading)
            clear = profile[np.abs(profile) > _LEAST * np.abs(profile).max()]
            return order, int(np.count_nonzero(np.diff(np.sign(clear))))
    return None
