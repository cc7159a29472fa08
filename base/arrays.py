"""Kinds of arrays, by what they hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Real numbers.
Array = NDArray[np.float64]
#: Real or complex numbers: the values of formulas that are also asked with complex steps.
AnyArray = NDArray[Any]
#: Whole numbers: places in other arrays, counts.
Numbers = NDArray[np.int64]
#: True for the entries that are selected.
Mask = NDArray[np.bool_]
#: Columns of a table by name, of numbers or of texts.
Columns = Mapping[str, AnyArray]
