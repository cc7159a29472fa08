"""Variables of equilibrium states: one table of what a state of a film shows.

A variable is one entry: its name with its unit, its meaning, and a function of states. The function
is called with the states of one finite-element film
(:class:`~tympan.fem.results.solved_states.SolvedStates`) and with those of many reduced films
(:class:`~tympan.studies.films.states.FilmStates`), which have the same names. So a variable that is
registered here is a result of ``solve``, of a path's stations, of the samples of a motion, a column
of sweeps, and a quantity whose bounds tolerances and designs keep.

    VARIABLES.register(Variable("min_thickness_m", "least thickness of the film", "length",
                                lambda states: states.least(lambda film: film.thickness)))
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Protocol, Self, cast

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.fields import Key, Printed, Registry
from tympan.base.units import DIMENSIONS

#: Field of a film: its values at points from :class:`~tympan.fem.results.fields.Fields`, or from
#: :class:`~tympan.studies.films.many_films.LocalState`, which has the scalar ones of these.
Field = Callable[[Any], AnyArray]


class States(Protocol):
    """Equilibrium states of films, in SI: (states,) of one film, (films, states) of reduced films.

    Values are nan where a state does not have them. ``deflection`` of the plate; ``force`` that the
    film carries; ``capacitance`` and ``energy`` of the film; largest ``stretch`` and true
    ``stress``; least ``tension``, the stress of a film that bears compression; largest ``electric``
    field; largest share of the electric strength, ``breakdown``, and its place in the mounted film,
    ``weakest`` (…, 2); ``tilt`` of the plate, its ``slope`` and its ``shift`` along x and y (…, 2);
    mounted area without tension in all directions,
    ``slack_area``, and its share of the film.
    """

    @property
    def deflection(self) -> AnyArray: ...
    @property
    def force(self) -> AnyArray: ...
    @property
    def capacitance(self) -> AnyArray: ...
    @property
    def energy(self) -> AnyArray: ...
    @property
    def stretch(self) -> AnyArray: ...
    @property
    def stress(self) -> AnyArray: ...
    @property
    def tension(self) -> AnyArray: ...
    @property
    def electric(self) -> AnyArray: ...
    @property
    def breakdown(self) -> AnyArray: ...
    @property
    def weakest(self) -> AnyArray: ...
    @property
    def tilt(self) -> AnyArray: ...
    @property
    def slope(self) -> AnyArray: ...
    @property
    def shift(self) -> AnyArray: ...
    @property
    def slack_area(self) -> AnyArray: ...
    @property
    def slack_share(self) -> AnyArray: ...

    def largest(self, field: Field) -> AnyArray:
        """Find the largest value of a field at the nodes of every element."""

    def least(self, field: Field) -> AnyArray:
        """Find the least value of a field at the nodes of every element."""

    def mean(self, field: Field, *, covered: bool = False) -> AnyArray:
        """Average a field over the mounted film, or over its part ``covered`` by the electrode."""


@dataclass(frozen=True)
class Variable:
    """Quantity of a state: its ``key`` in results, which ends in its SI unit, and its meaning.

    ``dimension``: of :data:`~tympan.base.units.DIMENSIONS`, "" for plain numbers. ``of`` computes
    its values for :class:`States`; None where a state alone does not show it, and the study that
    knows the rest fills it in. ``of_plate``: only films with a plate have it. ``bounded``: bounds
    of it may be asked for. ``gain``: whether more of it is better, or less; None where a bound must
    say so.
    """

    key: str
    meaning: str
    dimension: str = ""
    of: Callable[[States], AnyArray] | None = None
    of_plate: bool = False
    bounded: bool = True
    gain: bool | None = None

    def __post_init__(self) -> None:
        if not self.key.endswith(self.suffix):
            raise ValueError(f"the key {self.key!r} must end in {self.suffix!r}")

    @property
    def suffix(self) -> str:
        """End of its key: the SI unit."""
        return DIMENSIONS[self.dimension].suffix if self.dimension else ""

    @property
    def name(self) -> str:
        """Name of its bounds: the key without the unit."""
        return self.key.removesuffix(self.suffix)


def _margin(states: States) -> AnyArray:
    share = states.breakdown
    return np.asarray(1 / np.where(share > 0, share, np.nan))


#: Slope [rad] and shift [m] below which they are rounding.
_ROUNDING = 1e-13


def _slope(axis: int) -> Callable[[States], AnyArray]:
    return lambda states: _settled(states.slope[..., axis])


def _shift(axis: int) -> Callable[[States], AnyArray]:
    return lambda states: _settled(states.shift[..., axis])


def _settled(values: AnyArray) -> AnyArray:
    """Set what is rounding to 0: a plate that nothing moves aside is straight."""
    return np.where(np.abs(values) < _ROUNDING, 0.0, values)


def _weakest(axis: int) -> Callable[[States], AnyArray]:
    return lambda states: np.where(states.breakdown > 0, states.weakest[..., axis], np.nan)


#: All variables of a state by their keys, in the order in which results list them.
VARIABLES: Registry[Variable] = Registry("key")
for _variable in (
    Variable("deflection_m", "deflection of the plate, downwards", "length",
             lambda states: states.deflection),
    Variable("stroke_m", "deflection less that without voltage, under the same mass; none without "
             "voltage, and where mass or pressure grows", "length"),
    Variable("reading_m", "what the rig's sensor shows of the deflection", "length"),
    Variable("reaction_N", "force that the film carries", "force",
             lambda states: states.force, of_plate=True),
    Variable("capacitance_F", "capacitance of the film as it is", "capacitance",
             lambda states: states.capacitance),
    Variable("max_stretch", "largest principal stretch, from the virgin film", "",
             lambda states: states.stretch, gain=False),
    Variable("max_true_stress_Pa", "largest principal true stress", "stress",
             lambda states: states.stress, gain=False),
    Variable("least_stress_Pa", "smallest principal true stress, of a film kept from wrinkling",
             "stress", lambda states: states.tension, gain=True),
    Variable("max_field_V_per_m", "largest electric field, voltage over thickness", "field",
             lambda states: states.electric, gain=False),
    Variable("breakdown_margin", "smallest strength over field; none without voltage or a strength "
             "law", "", _margin, gain=True),
    Variable("breakdown_share", "largest field over strength; 0 where the strength is unknown", "",
             lambda states: states.breakdown, gain=False),
    Variable("breakdown_x_m", "where the margin is smallest, in the mounted film", "length",
             _weakest(0), bounded=False),
    Variable("breakdown_y_m", "y of the same place", "length", _weakest(1), bounded=False),
    Variable("slack_area_m2", "mounted area that carries tension in one direction or none", "area",
             lambda states: states.slack_area, gain=False),
    Variable("slack_share", "its share of the mounted area", "",
             lambda states: states.slack_share, gain=False),
    Variable("tilt_rad", "tilt of the plate", "angle", lambda states: states.tilt, of_plate=True,
             gain=False),
    Variable("tilt_x_rad", "slope of the plate along x: positive where its side towards positive x "
             "is deflected further", "angle", _slope(0), of_plate=True),
    Variable("tilt_y_rad", "slope of the plate along y", "angle", _slope(1), of_plate=True),
    Variable("shift_x_m", "motion of the plate's centre along x", "length", _shift(0),
             of_plate=True),
    Variable("shift_y_m", "the same along y", "length", _shift(1), of_plate=True),
    Variable("energy_J", "elastic energy of the film from the virgin state on, less half the "
             "capacitance times the voltage squared; without the energy of the weight", "energy",
             lambda states: states.energy),
):
    VARIABLES.register(_variable)


def variables_of(states: States, *, plate: bool) -> dict[str, AnyArray]:
    """Compute all variables of states by their keys; ``plate``: the films have one."""
    return {key: variable.of(states) for key, variable in VARIABLES.items()
            if variable.of is not None and (plate or not variable.of_plate)}


def rows_of_variables(states: States, *, plate: bool) -> Iterator[dict[str, float | None]]:
    """Yield the variables of each state of one film, (states,), by their keys; None for nan."""
    columns = {key: values.tolist()
               for key, values in variables_of(states, plate=plate).items()}
    for row in zip(*columns.values(), strict=True):
        yield {key: None if value != value else float(value)
               for key, value in zip(columns, row, strict=True)}


#: Field of a result with the variables of a state by their keys; None for those that the state does
#: not have. In JSON and in tables they stand among the result's own keys.
StateValues = Annotated[Mapping[str, float | None], Key("variables of the state by their keys"),
                        Printed(choices=VARIABLES, inline=True)]


class ShowsState:
    """Part of a result with a field ``values`` of :data:`StateValues`: each is an attribute."""

    values: Mapping[str, float | None]

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", {key: self.values.get(key) for key in VARIABLES})

    def __getattr__(self, key: str) -> Any:
        if key not in VARIABLES:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {key!r}")
        return self.values.get(key)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *VARIABLES]

    def showing(self, **values: float | None) -> Self:
        """Copy the result with other values of some variables, by their keys."""
        changed = replace(cast(Any, self), values={**self.values, **values})
        return cast(Self, changed)
