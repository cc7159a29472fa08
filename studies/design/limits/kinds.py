"""Limits a design must keep: values and derivatives of c ≤ 0, and what is limited in SI units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.complex_step import STEP
from tympan.fem.derivatives.quantities import Field, larger_stress, largest, true_field
from tympan.fem.film.density import principal_stretches
from tympan.fem.membrane.model import Model
from tympan.fem.results.fields import strength
from tympan.geometry.paths import with_change
from tympan.geometry.specimen import Specimen
from tympan.studies.design.limits.state import DesignState, Evaluation, slopes_of

Array = NDArray[np.float64]

#: Power of the norm that stands for a largest value: at 64 it is 2 to 10 % short, at 200 some 2 %.
_POWER = 200
#: Points along the plate's edge whose distances from the frame are limited.
_POINTS = 64


@dataclass(frozen=True)
class DesignLimit:
    """A kind of limit.

    ``evaluate`` takes a state and the bound [SI]: the largest of stresses and fields, the smallest
    of margins and gaps. ``load`` is what of a state must stay low; a limit that has one holds at
    every voltage of a cycle (:mod:`tympan.studies.design.limits.cycle`), others at the working
    one, or, not ``of_voltage``, at any.
    """

    evaluate: Callable[[DesignState, float], Evaluation]
    load: Callable[[DesignState], float] | None = None
    of_voltage: bool = True


def _highest(name: str, field: Field, stored: str, state: DesignState, bound: float,
             inverse: bool = False) -> Evaluation:
    """The largest value of a field over the film; as a margin if the file limits one over it.

    c is its stand-in over the highest allowed, minus one: a norm, times the largest nodal value
    over that norm on the mesh the moved ones come from.
    """
    highest, smooth = _load(stored, state), largest(field, _POWER)
    if highest == 0:  # a field without voltage
        return Evaluation(np.inf if inverse else 0.0, -np.ones(1), np.zeros((1, len(state.by))))
    norm = float(smooth.value(state.model, state.outcome.state))
    scale = state.memory.scales.setdefault(f"{name} {state.name}", highest / norm)
    share = scale * (bound if inverse else 1 / bound)
    slopes = slopes_of(smooth, state.model, state.outcome, state.by)
    return Evaluation(1 / highest if inverse else highest, np.array([share * norm - 1]),
                      share * slopes[None])


def _load(stored: str, state: DesignState) -> float:
    """The largest value of a field over the film."""
    return float(np.max(getattr(state.fields, stored)))


def _gap(state: DesignState, bound: float) -> Evaluation:
    """Smallest distance of the plate's edge from the frame; c is one minus distances over gap.

    Points that symmetry repeats are left out. Feet on the frame stay, for a distance is smallest at
    its foot.
    """
    specimen = state.case.specimen

    def edge(specimen: Specimen) -> Any:
        plate = specimen.needed_plate()
        return plate.outline.points(_POINTS).T + np.array(plate.offset)

    def across(specimen: Specimen) -> Any:
        return specimen.frame.curve.at(feet)[0] - edge(specimen)

    points = edge(specimen)
    feet = specimen.frame.curve.foot(points)
    chosen = np.ones(len(points), dtype=bool)
    for axis in specimen.mirror_planes:
        chosen &= points[:, "xy".index(axis)] >= -1e-9
    distances = np.linalg.norm(across(specimen), axis=1)[chosen]
    slopes = np.empty((len(distances), len(state.by)))
    for column, name in enumerate(state.by):
        stepped = across(with_change(specimen, name.split("."), 1j * STEP))[chosen]
        slopes[:, column] = np.sqrt((stepped**2).sum(axis=1)).imag / STEP
    return Evaluation(specimen.gap, 1 - distances / bound, -slopes / bound)


def _breakdown_share(model: Model, voltage_squared: Any, c: tuple[Any, Any, Any]) -> Any:
    """Field over strength, 0 outside the electrode."""
    film = model.specimen.membrane
    l1, l2 = principal_stretches(c, film.prestretch)
    return true_field(model, voltage_squared, c) / strength(film, l1, l2,
                                                            film.thickness / (l1 * l2))


#: Largest true stress.
STRESS = DesignLimit(partial(_highest, "max_true_stress", larger_stress, "stress_1"),
                     partial(_load, "stress_1"))
#: Largest field.
FIELD = DesignLimit(partial(_highest, "max_field", true_field, "electric_field"),
                    partial(_load, "electric_field"))
#: Margin of the field to the electric strength.
BREAKDOWN_SHARE = DesignLimit(
    partial(_highest, "breakdown_margin", _breakdown_share, "breakdown_share", inverse=True),
    partial(_load, "breakdown_share"))
#: Gap between plate and frame.
GAP = DesignLimit(_gap, of_voltage=False)
