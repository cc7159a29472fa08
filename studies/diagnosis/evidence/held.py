"""Plates held at a heave: the force that this takes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.evidence.kind import Films, PlateEvidence

Array = NDArray[np.float64]


class Held(PlateEvidence):
    """Forces that hold plates where they are [N]: no file has them yet, but they are proposed."""

    files = ()
    kinds = ("force",)

    def shown(self, films: Films, kind: str, rows: NDArray[np.int64], heave: Array) -> Array:
        return films.force(heave)[films.table.state[rows]]
