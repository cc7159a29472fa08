"""A design's film at one voltage, as limits look at it, and what they answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tympan.fem.derivatives.quantities import Quantity
from tympan.fem.derivatives.sensitivity import ModelParameter, gradient_many
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import Fields, node_fields
from tympan.studies.case import Case
from tympan.studies.limits.voltages import EndKind

Array = NDArray[np.float64]


class Evaluation(NamedTuple):
    """Value of a limit [its unit], c to be ≤ 0, shape (m,), and ∇c (m, parameters).

    ``end``: how the film ends, where that is what is measured and it does. Over a cycle of the
    voltage the value is that nearest to the bound, ``at_V`` volts, and ``voltages`` are those that
    each c is at, None where the limit depends on none; ``between``: it comes nearest between the
    cycle's ends.
    """

    value: float
    c: Array
    slopes: Array
    end: EndKind | None = None
    at_V: float | None = None
    voltages: tuple[float | None, ...] = ()
    between: bool = False


@dataclass(eq=False)
class MeshMemory:
    """Memory of a mesh that moves, so that values and derivatives belong together.

    Empty of a new mesh, which fills it. ``scales``: by how much smooth maxima fall short of the
    largest nodal value, by limit and state; ``sectors`` around the plate in which the nodes of
    every element are; ``rates`` at which the film's firmness is used up there [Pa/V²], by the kind
    of end.
    """

    scales: dict[str, float] = field(default_factory=dict)
    sectors: NDArray[np.int64] | None = None
    rates: dict[tuple[EndKind, int], float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class DesignState:
    """A design's equilibrium on a model, and the parameters to differentiate by, by name.

    ``memory`` of the mesh that the model was moved from; ``uncharged``: the film without voltage;
    ``name``: which of a design's states, for limits at several voltages.
    """

    case: Case
    model: Model
    outcome: Outcome
    by: Mapping[str, ModelParameter]
    memory: MeshMemory
    path: PathSettings
    uncharged: State
    name: str = ""

    @cached_property
    def fields(self) -> Fields:
        """Fields at the nodes of all elements."""
        return node_fields(self.model, [self.outcome.state])[0]


def slopes_of(quantity: Quantity, model: Model, outcome: Outcome, by: Mapping[str, ModelParameter]
              ) -> Array:
    """Derivatives of a quantity of an equilibrium by parameters, shape (parameters,)."""
    return np.array(list(gradient_many(model, outcome, {"": quantity}, by)[""].values()))
