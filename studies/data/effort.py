"""Work that readings take."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tympan.base.fields import Key
from tympan.base.toml_reader import NON_NEGATIVE, POSITIVE, Rule

_SHARE: Rule = (lambda x: 0 <= x <= 1, "must be from 0 to 1")


@dataclass(frozen=True)
class Effort:
    """Time that work on a test bench takes [s]; the defaults are guesses, for users to replace."""

    reading: Annotated[float, Key("one more reading, its voltage set", "time", POSITIVE)] = 20.0
    load: Annotated[float, Key("a run under another mass, or once more", "time",
                               NON_NEGATIVE)] = 120.0
    specimen: Annotated[float, Key("another specimen on the stand", "time", NON_NEGATIVE)] = 300.0
    capacitance: Annotated[float, Key("to set up the measurement of the capacitance", "time",
                                      NON_NEGATIVE)] = 1200.0
    probe: Annotated[float, Key("to set up a high-voltage probe on the film", "time",
                                NON_NEGATIVE)] = 900.0
    force: Annotated[float, Key("to set up a force gauge that holds the plate", "time",
                                NON_NEGATIVE)] = 3600.0
    tap: Annotated[float, Key("to set up the recording of free swings", "time",
                              NON_NEGATIVE)] = 900.0
    line: Annotated[float, Key("to set up a laser line over a film", "time",
                               NON_NEGATIVE)] = 1800.0
    make: Annotated[float, Key("to make a specimen of another shape", "time",
                               NON_NEGATIVE)] = 4 * 3600.0
    coupons: Annotated[float, Key("to cut strips and set up a tensile test", "time",
                                  NON_NEGATIVE)] = 2 * 3600.0
    waiting: Annotated[float, Key("share of a pause that counts as work", rule=_SHARE)] = 0.1
