"""Random moves of the explorer's controls, as many a hand would make them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tympan.base.errors import InputError
from tympan.explore.view import FilmView, changed, controls

#: Loads are moved more often than sizes.
_LOADS = ("voltage", "mass")


def random_views(start: FilmView, count: int, seed: int = 0, most_voltage: float = 9e3
                 ) -> Iterator[FilmView]:
    """So many views, each one slider away from the last; what cannot be built is left out."""
    generator, view = np.random.default_rng(seed), start
    choice = controls(start, most_voltage)
    sizes = [control for control in choice if control.key not in _LOADS]
    while count:
        loads = generator.random() < 0.6
        control = (choice if loads else sizes)[generator.integers(2 if loads else len(sizes))]
        steps = round((control.high - control.low) / control.step)
        value = control.low + control.step * int(generator.integers(steps + 1))
        try:
            view = changed(view, control.key, value / control.factor)
        except InputError:
            continue
        count -= 1
        yield view
