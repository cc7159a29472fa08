"""Progress of long computations: reported in words, or as the number of finished parts."""

from __future__ import annotations

from collections.abc import Callable

#: Function that is called with the next operation, in words.
Progress = Callable[[str], None]

#: Function that is called with the number of finished parts and the total number.
PartsDone = Callable[[int, int], None]

#: Function that is called with the computed share of a motion, from 0 to 1.
ShareDone = Callable[[float], None]
