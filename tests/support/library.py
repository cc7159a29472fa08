"""Few effects in place of the whole library, for verdicts that are not about the library."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from tympan.studies.effects import EFFECTS

#: Every effect: a verdict among all of them is dear, since all their films are solved and all their
#: pairs are weighed.
WHOLE = tuple(EFFECTS)


@contextmanager
def library_of(*names: str) -> Iterator[None]:
    """Leave these effects alone in the library, in its order, from the files to the page."""
    every = dict(EFFECTS)
    assert set(names) <= set(every)
    EFFECTS.clear()
    EFFECTS.update({name: effect for name, effect in every.items() if name in names})
    try:
        yield
    finally:
        EFFECTS.clear()
        EFFECTS.update(every)
