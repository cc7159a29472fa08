"""Numbers that the paper prints, as far as they survived: ranges, percentages, settling times."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.data.dataset import read_dataset

#: Rows of all tables here: the masses on the plate [kg].
MASSES = (17.9e-3, 22.45e-3)
#: Columns of all tables here.
NAMES = ("circular", "elliptical-small", "elliptical-large")

#: Lowest voltage of Table 2 and of figures 7, 8 and 14 [V].
LOWEST = 0.0
#: Highest voltage of Table 2 and of figures 7, 8 and 14 [V].
HIGHEST = 7e3

#: Figures 9–12 step from the first voltage to the second [V].
STEP = (0.0, 3.5e3)
#: Interval between switches in figure 14 [s].
SWITCH = 30.0
#: Figure 13: (u₀, u₁) [V] of its left and its right column.
SINES = ((0.0, 1e3), (3.5e3, 3.5e3))
#: Section 4.2: settling times of the oscillation [s].
SETTLING: Array = np.array([[2.12, 2.38, 2.34], [2.28, 2.36, 2.27]])
#: Table 2: ranges as percentages of the circle's under the same mass.
PERCENTAGES: Array = np.array([[100.0, 114.0, 126.0], [100.0, 123.0, 135.0]])
#: Table 1: electrode surfaces [m²].
SURFACES: Array = np.array([60.5e-4, 81.7e-4, 102.9e-4])
#: Half of the last digit that Table 2 prints [m].
ROUNDING = 5e-6


def ranges() -> Array:
    """Read Table 2's distance ranges [m], (masses, actuators), from dataset ``paper-table-2``.

    Examples
    --------
    >>> (1e3 * ranges()).round(3).tolist()
    [[1.64, 1.86, 2.06], [1.75, 2.16, 2.37]]
    """
    read = read_dataset(Path(str(resources.files("tympan.paper") / "table-2"))).ranges
    assert read is not None
    place = {(str(name), round(1e6 * mass)): value
             for name, mass, value in zip(read.specimen, read.mass, read.range, strict=True)}
    return np.array([[place[name, round(1e6 * mass)] for name in NAMES] for mass in MASSES])
