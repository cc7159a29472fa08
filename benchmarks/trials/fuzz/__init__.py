"""Input as nobody would write it: whatever it says, reading ends soon, with a message or not.

    python -m benchmarks.trials.fuzz --minutes 60 --seed 1 [--only KIND]

Contents that can be read are changed, a few places at a time: keys, numbers, units, lines, bytes. A
find is any exception but a refusal, more than two seconds of processor time, or the end of the
process. Batches run in processes of their own; what one read last is kept in its folder. A file of
this folder registers the kinds of its subject, and is found by itself.
"""

from __future__ import annotations

import importlib
import pkgutil

from benchmarks.trials.fuzz.kind import KINDS, Kind


def kinds() -> dict[str, Kind]:
    """Every kind, by name."""
    for module in sorted(entry.name for entry in pkgutil.iter_modules(__path__)):
        if module != "__main__":
            importlib.import_module(f"{__name__}.{module}")
    return KINDS
