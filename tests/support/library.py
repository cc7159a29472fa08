"""Few effects in place of the whole library, for verdicts that are not about the library."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

import pytest

from tests.support.costs import dear
from tympan.studies.effects import EFFECTS

Test = TypeVar("Test", bound=Callable[..., None])

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


def among(*names: str, seconds: float) -> Callable[[Test], Test]:
    """Run a test with these effects alone in the library, and dear with every one.

    Its verdict is about its evidence, not about the library. ``seconds``: with the whole library.
    """
    def marked(test: Test) -> Test:
        both = pytest.mark.parametrize(
            "library", [pytest.param(names, id="few"), dear(WHOLE, seconds=seconds, name="whole")],
            indirect=True)
        return pytest.mark.usefixtures("library")(both(test))

    return marked
