"""Kinds of arrays, by what they hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Real numbers.
Array = NDArray[np.float64]
#: Real or complex numbers: formulas that take complex steps, and what they are asked of.
AnyArray = NDArray[Any]
#: Whole numbers: places in other arrays, counts.
Numbers = NDArray[np.int64]
#: Which of some are meant.
Mask = NDArray[np.bool_]
#: Columns of a table by name, of numbers or of texts.
Columns = Mapping[str, AnyArray]
