"""Points that fill a cube: at random, in a Latin hypercube, or a Sobol sequence."""

from __future__ import annotations

from typing import Literal

import numpy as np

from tympan.base.arrays import Array
from tympan.base.process.interruption import signals_wait

#: Ways to draw points.
Drawing = Literal["random", "latin_hypercube", "sobol"]


def drawn_points(dimensions: int, count: int, seed: int, method: Drawing = "sobol") -> Array:
    """Draw points in the unit cube, shape (count, dimensions); the same ones for a seed.

    Of a Sobol sequence they are the first points of the scrambled one; a power of two of them is
    balanced. Signals wait: scipy's sequence swallows an interruption and then has all points equal.
    """
    from scipy.stats import qmc  # takes half a second, also for those who draw nothing

    rng = np.random.default_rng(seed)
    with signals_wait():
        if method == "random":
            return rng.random((count, dimensions))
        if method == "latin_hypercube":
            cube: Array = qmc.LatinHypercube(dimensions, seed=rng).random(count)
            return cube
        power = max(count - 1, 0).bit_length()
        sequence: Array = qmc.Sobol(dimensions, seed=rng).random_base2(power)
        return sequence[:count]
