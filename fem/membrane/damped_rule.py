"""A rule for steps in time: trapezoidal, damped for motions that decay within one step.

y₁ = y₀ + h ((1 − θ) ẏ₀ + θ ẏ₁). With θ = ½ a motion that decays in a time T much shorter than h
rings, and grows when whole and halved steps are extrapolated; with θ = 1, Euler's implicit rule, it
is damped (Hairer and Wanner, *Solving Ordinary Differential Equations II*, §IV.3). So θ goes from
½ to 1 with h/T. As θ − ½ is odd in h, the error remains a series in h², whose first term is the
trapezoidal rule's.
"""

from __future__ import annotations

#: θ where nothing decays.
TRAPEZOIDAL = 0.5

#: h/T at which θ is ¾. The extrapolated trapezoidal rule still damps motions that decay this fast.
_TURN = 8.0
#: h/T above which θ is 1: the cube of a larger one might overflow.
_LONG = 1e6


def end_weight(ratio: float) -> float:
    """Compute θ of a step of a length h over the time T in which a motion decays.

    Examples
    --------
    >>> [round(end_weight(ratio), 6) for ratio in (0.0, 1.0, 8.0, 1e3)]
    [0.5, 0.500975, 0.75, 1.0]
    """
    cube = min(ratio, _LONG) ** 3
    return TRAPEZOIDAL + cube / (_TURN**3 + cube) / 2


def end_weights(duration: float, stiffness: float, damper: float, mass: float
                ) -> tuple[float, float]:
    """Compute θ of a plate's motion and of its momentum over a step [s].

    The film has a ``stiffness`` [N/m]. A damped momentum decays at c/m; a plate that is overdamped
    by its damper c [N s/m] creeps at k/c.
    """
    if not damper:
        return TRAPEZOIDAL, TRAPEZOIDAL
    creep = max(stiffness, 0.0) / damper if damper**2 > 4 * stiffness * mass else 0.0
    return (end_weight(duration * creep),
            end_weight(duration * damper / mass) if mass else TRAPEZOIDAL)
