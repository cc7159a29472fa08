"""The missing ε_r and α from Table 2 read over pseudo-random steps, at the end of each level."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from tympan.studies.lumped.signals import Signal
from tympan.studies.lumped.simulate import creep
from tympan.studies.paper.published import ranges
from tympan.studies.replica.missing_parameters import MissingParameters, actuators

Array = NDArray[np.float64]
_STEPS = np.array([1e-2, 1e-2])  # of ε_r and α₁, for their derivatives
_START = np.array([9.0, 0.5])
_DRAWN_IN = 1e-2  # [m], far beyond any range: the search turns back


def level_ranges(signal: Signal, values: Array) -> Array:
    """Ranges [m] at the ends of a signal's levels with pairs of ε_r and α₁.

    Shape (pairs, masses, actuators).
    """
    permittivity, alpha = values.T
    levels = creep(actuators(permittivity, np.array([alpha, alpha]).T), signal)
    return np.asarray(np.ptp(levels, axis=0))


def fit_levels(signal: Signal) -> MissingParameters:
    """ε_r and α₁, one for both ellipses, by least squares over Table 2's ranges at levels' ends.

    Inertia's overshoot does not count: it is gone within seconds of a switch.

    Raises
    ------
    InputError
        When the signal goes beyond pull-in on the way.
    """
    read, kept = ranges(), dict[bytes, tuple[Array, Array]]()

    def both(values: Array) -> tuple[Array, Array]:
        key = np.asarray(values).tobytes()
        if key not in kept:
            # Steps towards the middle of what is allowed, so that none leaves it.
            moves = np.diag(np.where(values > _START, -_STEPS, _STEPS))
            with np.errstate(all="ignore"):
                tried = level_ranges(signal, np.vstack([values, values + moves]))
            first, *others = np.nan_to_num(tried, nan=_DRAWN_IN)
            slopes = (np.array(others) - first).reshape(2, -1) / moves.sum(axis=1)[:, None]
            kept[key] = first, slopes.T
        return kept[key]

    done = least_squares(lambda values: 1e3 * (both(values)[0] - read).ravel(), _START,
                         lambda values: 1e3 * both(values)[1], ((1.0, 0.0), (11.0, 1.0)), xtol=1e-5,
                         ftol=1e-7, max_nfev=12)
    fitted, (permittivity, alpha) = both(done.x)[0], done.x.tolist()
    return MissingParameters(permittivity, (alpha, alpha), fitted, fitted - read)
