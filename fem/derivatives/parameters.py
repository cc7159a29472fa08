"""What an equilibrium can be differentiated by, by name: numbers of film, shape and surroundings.

A parameter says how model and state change with it, for a real change and for an imaginary one. So
the same few lines serve the complex step, which gives derivatives exact to rounding, and finite
changes, which check them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite
from typing import Any, Protocol

import numpy as np

from tympan.fem.derivatives.shape import Velocities, moved_by, velocities
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.geometry.errors import InputError
from tympan.geometry.paths import at, at_name, numbers, with_change
from tympan.geometry.specimen import Specimen

#: Loads by name: node positions hold, the load changes.
LOADS = ("force", "voltage", "pressure")


class ModelParameter(Protocol):
    """One number that model or state depend on.

    ``moves``: whether a change moves the nodes. ``odd``: the axes whose reversal turns it into its
    opposite.
    """

    @property
    def moves(self) -> bool: ...

    @property
    def odd(self) -> frozenset[str]: ...

    def value(self, model: Model, state: State) -> float:
        """Its present value [SI]."""

    def changed(self, model: Model, state: State, change: Any) -> tuple[Model, State]:
        """Model and state after a change, real or imaginary.

        Every node keeps its displacement from its own place.
        """


@dataclass(frozen=True)
class ModelNumber:
    """A number of film, electrode or surroundings, at a path of the model; it moves no node."""

    path: tuple[str, ...]
    moves = False

    @property
    def odd(self) -> frozenset[str]:
        """The axis an arm is along."""
        return frozenset("xy"[int(self.path[-1])]) if "arm" in self.path else frozenset()

    def value(self, model: Model, state: State) -> float:
        return float(at(model, self.path))

    def changed(self, model: Model, state: State, change: Any) -> tuple[Model, State]:
        return with_change(model, self.path, change), state


@dataclass(frozen=True)
class LoadNumber:
    """The force on the plate [N], the voltage [V] or the gas pressure [Pa]."""

    name: str
    moves = False
    odd = frozenset[str]()

    def value(self, model: Model, state: State) -> float:
        if self.name == "voltage":
            return float(np.sqrt(state.voltage_squared))
        return float(getattr(state, self.name))

    def changed(self, model: Model, state: State, change: Any) -> tuple[Model, State]:
        value = self.value(model, state) + change
        return model, state.under(**{self.name: value**2 if self.name == "voltage" else value})


@dataclass(frozen=True)
class ShapeNumber:
    """A length of frame, plate or electrode; the mesh moves with it."""

    path: tuple[str, ...]
    velocities: Velocities
    moves = True

    @property
    def odd(self) -> frozenset[str]:
        """The axis an offset is along; both for a rotation."""
        if self.path[-1] == "rotation":
            return frozenset("xy")
        return frozenset("xy"[int(self.path[-1])]) if self.path[-2] == "offset" else frozenset()

    def value(self, model: Model, state: State) -> float:
        return float(at(model.specimen, self.path))

    def changed(self, model: Model, state: State, change: Any) -> tuple[Model, State]:
        specimen = with_change(model.specimen, self.path, change)
        return moved_by(model, state, specimen, change * self.velocities.of(self.path))


@dataclass(frozen=True)
class Parameters:
    """The parameters of a model by name."""

    model: Model

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All names: of film and electrode, loads, surroundings, shape."""
        loading = (name for name in numbers(self.model.loading, "loading")
                   if isfinite(at_name(self.model, name)))
        return (*film_names(self.model.specimen), *LOADS, *loading,
                *shape_names(self.model.specimen))

    def __getitem__(self, name: str) -> ModelParameter:
        """The parameter of a name.

        Raises
        ------
        InputError
            For a name that is no parameter of the model.
        """
        if name not in self.names:
            raise InputError(f"must be one of {', '.join(self.names)}", key="parameter", given=name)
        path = tuple(name.split("."))
        if name in LOADS:
            return LoadNumber(name)
        if path[0] == "loading":
            return ModelNumber(path)
        if name in shape_names(self.model.specimen):
            return ShapeNumber(path, velocities(self.model.discretisation, self.model.specimen))
        return ModelNumber(("specimen", *path))


def film_names(specimen: Specimen) -> tuple[str, ...]:
    """Names of the numbers of film and electrode that move nothing.

    Examples
    --------
    >>> from tympan.fem.film.laws import Ogden
    >>> from tympan.geometry.outlines import Circle
    >>> from tympan.geometry.specimen import Film, Plate
    >>> film = Film(1e-3, (2.2, 2.2), Ogden((20e3,), (2.0,)), 4.7)
    >>> film_names(Specimen("film", Circle(0.045), Plate(Circle(0.01)), film))[1:4]
    ('membrane.prestretch.0', 'membrane.prestretch.1', 'membrane.material.mu.0')
    """
    # Strength decides nothing but breakdown.
    return (*numbers(replace(specimen.membrane, strength=None), "membrane"), "electrode.stiffness")


def shape_names(specimen: Specimen) -> tuple[str, ...]:
    """Names of the lengths of frame and plate, and of an electrode with edges within the film.

    Corners and points that an outline is drawn through are among them where the specimen has no
    mirror plane.
    """
    electrode = specimen.electrode
    margins = (f"electrode.{name}" for name in ("margin_frame", "margin_plate")
               if getattr(electrode, name) > 0)
    names = (*numbers(specimen.frame, "frame"), *numbers(specimen.plate, "plate"), *margins,
             *numbers(electrode.outline, "electrode.outline"))
    # Moving one corner alone would break a mirror symmetry that the model may use.
    drawn = {"vertices", "through"} if specimen.mirror_planes else set()
    return tuple(name for name in names if drawn.isdisjoint(name.split(".")))
