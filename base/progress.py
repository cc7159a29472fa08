"""How long work says what it does: in words, or by counting its parts."""

from __future__ import annotations

from collections.abc import Callable

#: Called with what is done next, in words.
Progress = Callable[[str], None]

#: Called with the parts that are done, and with their number.
PartsDone = Callable[[int, int], None]

#: Called with the share of a motion that is computed, from 0 to 1.
ShareDone = Callable[[float], None]
