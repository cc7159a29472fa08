"""Limits a design must keep: values and derivatives of c ≤ 0, and what is limited in SI units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.complex_step import STEP
from tympan.fem.derivatives.parameters import ModelParameter
from tympan.fem.derivatives.quantities import Field, larger_stress, largest, true_field
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

#: What a limit measures [its unit], c to be ≤ 0, shape (m,), and ∇c (m, parameters).
Evaluation = tuple[float, Array, Array]

_MARGIN: Rule = (lambda x: 1 <= x <= 10, "must be a margin from 1 to 10")
#: Power of the norm that stands for a largest value: at 64 it is 2 to 10 % short, at 200 some 2 %.
_POWER = 200


@dataclass(frozen=True, eq=False)
class DesignState:
    """A design's equilibrium on a model, and the parameters to differentiate by, by name.

    ``scales``: by how much the smooth maxima of the mesh the model was moved from fell short of the
    largest nodal value. Held while a mesh moves, so that values and derivatives belong together.
    """

    case: Case
    model: Model
    outcome: Outcome
    by: Mapping[str, ModelParameter]
    scales: Mapping[str, float]
    path: PathSettings

    @cached_property
    def fields(self) -> Fields:
        """Fields at the nodes of all elements."""
        return node_fields(self.model, self.outcome.state)


@dataclass(frozen=True)
class Highest:
    """The largest value of a field over the film; as a margin if the file limits one over it.

    Its stand-in is a norm, times the largest nodal value over that norm on the mesh the moved ones
    come from.
    """

    bound: float
    name: str
    unit: str
    field: Field
    stored: str
    inverse: bool = False

    def scale(self, state: DesignState) -> float:
        """The largest nodal value over the norm."""
        return self._largest(state) / self._norm(state)

    def evaluate(self, state: DesignState) -> Evaluation:
        """From the largest nodal value; c is the stand-in over the highest allowed, minus one."""
        highest = self._largest(state)
        share = state.scales[self.name] * (self.bound if self.inverse else 1 / self.bound)
        norm = {"": largest(self.field, _POWER)}
        slopes = gradient_many(state.model, state.outcome, norm, state.by)[""]
        return (1 / highest if self.inverse else highest,
                np.array([share * self._norm(state) - 1]),
                share * np.array([[slopes[name] for name in state.by]]))

    def _largest(self, state: DesignState) -> float:
        return float(np.max(getattr(state.fields, self.stored)))

    def _norm(self, state: DesignState) -> float:
        return float(largest(self.field, _POWER).value(state.model, state.outcome.state))


@dataclass(frozen=True)
class PullIn:
    """Voltage of pull-in over that applied at one load, sought to ``reach`` times the limit."""

    bound: float
    name = "pull_in_margin"
    unit = "1"
    reach = 1.5

    def evaluate(self, state: DesignState) -> Evaluation:
        """The margin, or how far was searched; c is the margin asked for over it, minus one."""
        margin, slopes = self._pull_in(state)
        return (margin, np.array([self.bound / margin - 1]),
                -self.bound / margin**2 * slopes[None, :])

    def _pull_in(self, state: DesignState) -> tuple[float, Array]:
        """The margin and its derivatives.

        Where the search was cut short, by a film that wrinkles, the last margin state, which has no
        derivatives.
        """
        film, film_voltage = state.outcome.state, state.case.film_voltage
        end = equilibrium(state.model, film.force, self.reach * self.bound * film_voltage,
                          film.pressure, state.outcome.solution, state.path)
        flat = np.zeros(len(state.by))
        if end.critical is None or end.limited != "voltage":
            return float(np.sqrt(end.state.voltage_squared)) / film_voltage, flat
        margin = float(np.sqrt(end.critical.state.voltage_squared)) / film_voltage
        parameters = case_parameters(state.case, state.model, "voltage")
        try:
            slopes = limit_gradient(state.model, end.critical, "voltage",
                                    {name: parameters[name] for name in state.by})
        except InputError:  # no smooth limit: the film lost its stability otherwise
            return margin, flat
        return margin, np.array([slopes[name] for name in state.by]) / (2 * margin
                                                                        * film_voltage**2)


@dataclass(frozen=True)
class Gap:
    """Distances of points along the plate's edge from the frame, without what symmetry repeats."""

    bound: float
    name = "gap"
    unit = "m"
    points = 64

    def evaluate(self, state: DesignState) -> Evaluation:
        """The smallest distance; c is one minus distance over gap.

        Feet on the frame stay, for a distance is smallest at its foot.
        """
        specimen = state.case.specimen
        edge = self._edge(specimen)
        feet = Edge(specimen.frame, (0.0, 0.0)).foot(edge.T)
        distances = np.linalg.norm(self._across(specimen, feet), axis=1)
        chosen = np.ones(len(distances), dtype=bool)
        for axis in specimen.mirror_planes:
            chosen &= edge["xy".index(axis)] >= -1e-9
        slopes = np.empty((len(distances), len(state.by)))
        for column, name in enumerate(state.by):
            stepped = with_change(specimen, name.split("."), 1j * STEP)
            across = self._across(stepped, feet)
            slopes[:, column] = np.sqrt((across**2).sum(axis=1)).imag / STEP
        return (specimen.gap, 1 - distances[chosen] / self.bound, -slopes[chosen] / self.bound)

    def _edge(self, specimen: Specimen) -> Any:
        """Points of the plate's edge, shape (2, points)."""
        return specimen.plate.outline.points(self.points) + np.array(specimen.plate.offset)[:, None]

    def _across(self, specimen: Specimen, feet: tuple[Array, Array]) -> Any:
        """Vectors from the plate's edge to feet on the frame, shape (points, 2)."""
        return Edge(specimen.frame, (0.0, 0.0)).at(feet) - self._edge(specimen).T


def breakdown_share(model: Model, voltage_squared: Any, c: tuple[Any, Any, Any]) -> Any:
    """Field over strength, 0 outside the electrode."""
    film = model.specimen.membrane
    l1, l2 = principal_stretches(c, film.prestretch)
    return true_field(model, voltage_squared, c) / strength(film, l1, l2,
                                                            film.thickness / (l1 * l2))


#: ``bound`` [unit] is the largest of stresses and fields, the smallest of margins and gaps.
Limit = Highest | PullIn | Gap

#: Limits by their keys in problem files: of a bound, its dimension and rule.
LIMITS: dict[str, tuple[Callable[[float], Limit], str, Rule]] = {
    "max_true_stress": (partial(Highest, name="max_true_stress", unit="Pa", field=larger_stress,
                                stored="stress_1"), "stress", POSITIVE),
    "max_field": (partial(Highest, name="max_field", unit="V/m", field=true_field,
                          stored="electric_field"), "field", POSITIVE),
    "breakdown_margin": (partial(Highest, name="breakdown_margin", unit="1", field=breakdown_share,
                                 stored="breakdown_share", inverse=True), "", _MARGIN),
    "pull_in_margin": (PullIn, "", _MARGIN),
    "gap": (Gap, "length", POSITIVE)}


def read_limit(table: Table, key: str, specimen: Specimen) -> Limit:
    """The limit of one key of [limits]."""
    if key not in LIMITS:
        raise table.error(key, f"unknown limit: known are {', '.join(LIMITS)}")
    if key == "breakdown_margin" and specimen.membrane.strength is None:
        raise table.error(key, "needs a film whose electric strength is known (membrane.breakdown)")
    kind, dimension, rule = LIMITS[key]
    return kind(table.number(key, dimension, rule=rule))
