"""Tolerances for tests: of films that differ in nothing."""

from __future__ import annotations

from tympan.studies.tolerance.given import (
    LengthScatter,
    Scatter,
    ShareScatter,
    StrengthScatter,
    Tolerances,
)

NONE, NO_LENGTH = Scatter(), LengthScatter()
#: Nothing scatters; a test replaces what shall.
STILL = Tolerances(NONE, NONE, NONE, NONE, NO_LENGTH, NO_LENGTH, NO_LENGTH, NO_LENGTH, NONE, NONE,
                   StrengthScatter(shape=0), ShareScatter())
