"""Wanted quantities of films: values under their loads, and by how much they are missed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.outlines import area, perimeter
from tympan.geometry.specimen import Specimen
from tympan.geometry.toml_reader import POSITIVE, Rule
from tympan.geometry.units import DIMENSIONS

Array = NDArray[Any]

_MARGIN: Rule = (lambda x: 1 <= x <= 10, "must be a margin from 1 to 10")

#: Margin to the loss of tension where none is asked for: the film bears its voltage, no more.
TENSION = "tension_margin"
#: Margin to breakdown.
BREAKDOWN = "breakdown_margin"


class Loaded(Protocol):
    """Films without voltage, under theirs, and under that times a margin: (films, states) each.

    Of a film that has lost tension the numbers are those of one that bears compression; nan of one
    without equilibrium. ``force`` that the film carries [N], ``blocked_force`` that the voltage
    takes from a plate held where it is without [N], (films,); lowest ``frequency`` of the first
    two [Hz], (films,); ``limit``: over the voltage, that of the first loss of tension or of
    pull-in.
    """

    @property
    def specimens(self) -> Sequence[Specimen | None]: ...
    @property
    def voltage(self) -> Array: ...
    @property
    def deflection(self) -> Array: ...
    @property
    def force(self) -> Array: ...
    @property
    def stress(self) -> Array: ...
    @property
    def tension(self) -> Array: ...
    @property
    def electric(self) -> Array: ...
    @property
    def breakdown(self) -> Array: ...
    @property
    def blocked_force(self) -> Array: ...
    @property
    def frequency(self) -> Array: ...
    @property
    def limit(self) -> Array: ...


@dataclass(frozen=True)
class Quantity:
    """A quantity in ``words``, of which more is better, a ``gain``, or less.

    ``of`` films its values, (films,). What ``scatters`` differs between films of one drawing.
    """

    words: str
    dimension: str
    gain: bool
    of: Callable[[Loaded], Array]
    scatters: bool = True
    rule: Rule = POSITIVE

    @property
    def unit(self) -> str:
        """SI unit, "1" of plain numbers."""
        return DIMENSIONS[self.dimension].si if self.dimension else "1"

    @property
    def sense(self) -> str:
        """Sense of a bound: at least, or at most."""
        return "at least" if self.gain else "at most"


def misses(key: str, bound: float, films: Loaded) -> Array:
    """Share by which films miss a bound, (films,); not above 0 where they keep it.

    The margin to the loss of tension is looked at where it must not be lost yet: by what tension
    is left there, over the largest stress.
    """
    if key == TENSION:
        return np.asarray(-films.tension.min(1) / films.stress.max(1))
    quantity = QUANTITIES[key]
    share = quantity.of(films) / bound
    return 1 - share if quantity.gain else share - 1


def _of_specimen(measure: Callable[[Specimen], float]) -> Callable[[Loaded], Array]:
    def values(films: Loaded) -> Array:
        return np.array([np.nan if specimen is None else measure(specimen)
                         for specimen in films.specimens])
    return values


def _extent(axis: int) -> Callable[[Specimen], float]:
    return lambda specimen: float(np.ptp(specimen.frame.points(720)[axis]))


def _film_mass(specimen: Specimen) -> float:
    film, frame = specimen.membrane, float(area(specimen.frame))
    free = frame - float(area(specimen.needed_plate().outline))
    per_area = film.density * film.volume_per_area + film.layers * specimen.electrode.mass
    return float(free * per_area)


def _stroke(films: Loaded) -> Array:
    return np.asarray(np.abs(films.deflection[:, 1] - films.deflection[:, 0]))


def _work(films: Loaded) -> Array:
    return np.asarray(np.abs(films.force[:, :2].mean(1)) * _stroke(films))


def _breakdown_margin(films: Loaded) -> Array:
    with np.errstate(divide="ignore"):
        return np.asarray(1 / films.breakdown[:, 1])


#: By their keys in files.
QUANTITIES: dict[str, Quantity] = {
    "stroke": Quantity("stroke", "length", True, _stroke),
    "blocked_force": Quantity("blocked force", "force", True, lambda films: films.blocked_force),
    "work": Quantity("work", "energy", True, _work),
    "frequency": Quantity("frequency", "frequency", True, lambda films: films.frequency),
    TENSION: Quantity("margin to the loss of tension or pull-in", "", True,
                      lambda films: films.limit, rule=_MARGIN),
    BREAKDOWN: Quantity("margin to breakdown", "", True, _breakdown_margin, rule=_MARGIN),
    "gap": Quantity("gap between plate and frame", "length", True,
                    _of_specimen(lambda specimen: specimen.gap), scatters=False),
    "voltage": Quantity("voltage", "voltage", False, lambda films: films.voltage, scatters=False),
    "max_field": Quantity("largest field", "field", False, lambda films: films.electric[:, 1]),
    "max_true_stress": Quantity("largest true stress", "stress", False,
                                lambda films: films.stress[:, :2].max(1)),
    "film_mass": Quantity("mass of film and electrodes", "mass", False,
                          _of_specimen(_film_mass), scatters=False),
    "frame_area": Quantity("area of the frame", "area", False,
                           _of_specimen(lambda specimen: float(area(specimen.frame))),
                           scatters=False),
    "frame_perimeter": Quantity("perimeter of the frame", "length", False,
                                _of_specimen(lambda specimen: float(perimeter(specimen.frame))),
                                scatters=False),
    "width": Quantity("width of the frame", "length", False, _of_specimen(_extent(0)),
                      scatters=False),
    "height": Quantity("height of the frame", "length", False, _of_specimen(_extent(1)),
                       scatters=False),
}
