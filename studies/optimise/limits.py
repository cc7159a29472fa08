"""Limits a design must keep, each registered once.

Values and derivatives of c ≤ 0, and what it is in SI units.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tympan.fem.complex_step import STEP
from tympan.fem.derivatives.parameters import ModelParameter
from tympan.fem.derivatives.quantities import (
    Field,
    Quantity,
    larger_stress,
    largest,
    true_field,
)
from tympan.fem.derivatives.sensitivity import gradient_many, limit_gradient
from tympan.fem.derivatives.shape import Edge
from tympan.fem.equilibrium.ramp import Outcome, PathSettings, equilibrium
from tympan.fem.film.density import principal_stretches
from tympan.fem.membrane.model import Model
from tympan.fem.results.fields import Fields, strength
from tympan.geometry.errors import InputError
from tympan.geometry.paths import with_change
from tympan.geometry.specimen import Specimen
from tympan.geometry.toml_reader import POSITIVE, Rule, Table
from tympan.studies.case import Case, node_fields
from tympan.studies.sensitivity import case_parameters

Array = NDArray[np.float64]

_MARGIN: Rule = (lambda x: 1 <= x <= 10, "must be a margin from 1 to 10")
#: Power of the norm that stands for a largest value: at 64 it is 2 to 10 % short, at 200 some 2 %.
_POWER = 200


@dataclass(frozen=True, eq=False)
class DesignState:
    """A design's equilibrium on a model, and the names of the numbers to differentiate by.

    ``scales``: by how much the smooth maxima of the mesh the model was moved from fell short of the
    largest nodal value. Held while a mesh moves, so that values and derivatives belong together.
    """

    case: Case
    model: Model
    outcome: Outcome
    names: tuple[str, ...]
    scales: Mapping[str, float]
    path: PathSettings
    _pull_ins: dict[float, tuple[float, Array]] = field(default_factory=dict)

    @cached_property
    def by(self) -> dict[str, ModelParameter]:
        """Parameters by name."""
        return self._named(None)

    @cached_property
    def fields(self) -> Fields:
        """Fields at the nodes of all elements."""
        return node_fields(self.model, self.outcome.state)

    def pull_in(self, ceiling: float) -> tuple[float, Array]:
        """Voltage of pull-in over the film's voltage and its derivatives.

        Without pull-in, as far as was searched.

        Where the search was cut short, by a film that wrinkles, the last margin state, which has no
        derivatives.
        """
        if ceiling not in self._pull_ins:
            self._pull_ins[ceiling] = self._pull_in(ceiling)
        return self._pull_ins[ceiling]

    def _pull_in(self, ceiling: float) -> tuple[float, Array]:
        state, film_voltage = self.outcome.state, self.case.film_voltage
        end = equilibrium(self.model, state.force, ceiling * film_voltage, state.pressure,
                          self.outcome.solution,
                          self.path)
        if end.critical is None or end.limited != "voltage":
            searched = float(np.sqrt(end.state.voltage_squared))
            return searched / film_voltage, np.zeros(len(self.names))
        margin = float(np.sqrt(end.critical.state.voltage_squared)) / film_voltage
        try:
            slopes = limit_gradient(self.model, end.critical, "voltage", self._named("voltage"))
        except InputError:  # no smooth limit: the film lost its stability otherwise
            return margin, np.zeros(len(self.names))
        return margin, np.array([slopes[name] for name in self.names]) / (2 * margin
                                                                          * film_voltage**2)

    def _named(self, limited: Any) -> dict[str, ModelParameter]:
        parameters = case_parameters(self.case, self.model, limited)
        return {name: parameters[name] for name in self.names}


class Limit(Protocol):
    """One limit, or several of one kind.

    ``bound`` is what the file says [SI], ``unit`` its unit.
    """

    @property
    def name(self) -> str:
        """As in problem files."""

    @property
    def bound(self) -> float:
        """Of what is measured: largest for stresses and fields, smallest for margins and gaps."""

    @property
    def unit(self) -> str:
        """Of the bound."""

    def measured(self, state: DesignState) -> float:
        """The value that is limited [unit]."""

    def scale(self, state: DesignState) -> float:
        """By how much a smooth stand-in falls short of the value that is limited.

        1 where there is none.
        """

    def values(self, state: DesignState) -> tuple[Array, Array]:
        """c, shape (m,), to be ≤ 0, relative to the limit.

        And its derivatives by the numbers, shape (m, names).
        """


@dataclass(frozen=True)
class Highest:
    """The largest value of a field over the film; as a margin if the file limits one over it.

    Its stand-in is a norm, times the largest nodal value over that norm on the mesh the moved ones
    come from.
    """

    name: str
    bound: float
    unit: str
    field: Field
    stored: str
    inverse: bool = False

    def measured(self, state: DesignState) -> float:
        """From the largest nodal value."""
        largest = self._largest(state)
        return 1 / largest if self.inverse else largest

    def scale(self, state: DesignState) -> float:
        """The largest nodal value over the norm."""
        return self._largest(state) / self._norm(state)

    def values(self, state: DesignState) -> tuple[Array, Array]:
        """The stand-in over the highest allowed, minus one."""
        share = state.scales[self.name] * (self.bound if self.inverse else 1 / self.bound)
        slopes = gradient_many(state.model, state.outcome, {"": self._quantity}, state.by)[""]
        return np.array([share * self._norm(state)
                         - 1]), share * np.array([[slopes[name] for name in state.names]])

    @property
    def _quantity(self) -> Quantity:
        return largest(self.field, _POWER)

    def _largest(self, state: DesignState) -> float:
        return float(np.max(getattr(state.fields, self.stored)))

    def _norm(self, state: DesignState) -> float:
        return float(self._quantity.value(state.model, state.outcome.state))


@dataclass(frozen=True)
class PullIn:
    """Voltage of pull-in over that applied, at the same load.

    Searched up to ``reach`` times the limit.
    """

    bound: float
    name = "pull_in_margin"
    unit = "1"
    reach = 1.5

    def measured(self, state: DesignState) -> float:
        """The margin, or how far was searched."""
        return state.pull_in(self.reach * self.bound)[0]

    def scale(self, state: DesignState) -> float:
        """Needs no stand-in."""
        return 1.0

    def values(self, state: DesignState) -> tuple[Array, Array]:
        """The margin asked for over the margin, minus one."""
        margin, slopes = state.pull_in(self.reach * self.bound)
        return np.array([self.bound / margin - 1]), -self.bound / margin**2 * slopes[None, :]


@dataclass(frozen=True)
class Gap:
    """Distances of points along the plate's edge from the frame.

    Those mirror symmetry repeats are left out.
    """

    bound: float
    name = "gap"
    unit = "m"
    points = 64

    def measured(self, state: DesignState) -> float:
        """The smallest distance."""
        return state.case.specimen.gap

    def scale(self, state: DesignState) -> float:
        """Needs no stand-in: between its points a distance differs little from theirs."""
        return 1.0

    def values(self, state: DesignState) -> tuple[Array, Array]:
        """One minus distance over gap.

        Feet on the frame stay, for a distance is smallest at its foot.
        """
        specimen = state.case.specimen
        edge = _edge(specimen, self.points)
        feet = _frame(specimen).foot(edge.T)
        distances = np.linalg.norm(_across(specimen, self.points, feet), axis=1)
        chosen = np.ones(len(distances), dtype=bool)
        for axis in specimen.mirror_planes:
            chosen &= edge["xy".index(axis)] >= -1e-9
        slopes = np.empty((len(distances), len(state.names)))
        for column, name in enumerate(state.names):
            stepped = with_change(specimen, name.split("."), 1j * STEP)
            across = _across(stepped, self.points, feet)
            slopes[:, column] = np.sqrt((across**2).sum(axis=1)).imag / STEP
        return 1 - distances[chosen] / self.bound, -slopes[chosen] / self.bound


def _frame(specimen: Specimen) -> Edge:
    return Edge(specimen.frame, (0.0, 0.0))


def _edge(specimen: Specimen, count: int) -> Any:
    """Points of the plate's edge, shape (2, count)."""
    return specimen.plate.outline.points(count) + np.array(specimen.plate.offset)[:, None]


def _across(specimen: Specimen, count: int, feet: tuple[Array, Array]) -> Any:
    """Vectors from the plate's edge to feet on the frame, shape (count, 2)."""
    return _frame(specimen).at(feet) - _edge(specimen, count).T


def breakdown_share(model: Model, voltage_squared: Any, c: tuple[Any, Any, Any]) -> Any:
    """Field over strength, 0 outside the electrode."""
    film = model.specimen.membrane
    l1, l2 = principal_stretches(c, film.prestretch)
    return true_field(model, voltage_squared, c) / strength(film, l1, l2,
                                                            film.thickness / (l1 * l2))


def _stress(table: Table, specimen: Specimen) -> Limit:
    bound = table.quantity("max_true_stress", "stress", rule=POSITIVE)
    return Highest("max_true_stress", bound, "Pa", larger_stress, "stress_1")


def _field(table: Table, specimen: Specimen) -> Limit:
    bound = table.quantity("max_field", "field", rule=POSITIVE)
    return Highest("max_field", bound, "V/m", true_field, "electric_field")


def _breakdown(table: Table, specimen: Specimen) -> Limit:
    if specimen.membrane.strength is None:
        raise table.error("breakdown_margin",
                          "needs a film whose electric strength is known (membrane.breakdown)")
    margin = table.number("breakdown_margin", rule=_MARGIN)
    return Highest("breakdown_margin", margin, "1", breakdown_share, "breakdown_share",
                   inverse=True)


def _pull_in(table: Table, specimen: Specimen) -> Limit:
    return PullIn(table.number("pull_in_margin", rule=_MARGIN))


def _gap(table: Table, specimen: Specimen) -> Limit:
    return Gap(table.quantity("gap", "length", rule=POSITIVE))


#: Readers of limits by their keys in problem files.
LIMITS: dict[str, Callable[[Table, Specimen], Limit]] = {
    "max_true_stress": _stress, "max_field": _field, "breakdown_margin": _breakdown,
    "pull_in_margin": _pull_in,
    "gap": _gap}
