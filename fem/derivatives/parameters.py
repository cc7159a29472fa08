"""What an equilibrium can be differentiated by, by name: numbers of film, shape and surroundings.

A parameter says how model and state change with it, for a real change and for an imaginary one. So
the same few lines serve the complex step, which gives derivatives exact to rounding, and finite
changes, which check them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

import numpy as np

from tympan.fem.derivatives.shape import moved_by, velocity
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import Load, State
from tympan.geometry.errors import InputError
from tympan.geometry.paths import at, numbers, with_change
from tympan.geometry.specimen import Specimen

#: Loads by name: node positions hold, the load changes.
LOADS: tuple[Load, ...] = ("force", "voltage", "pressure")


@dataclass(frozen=True)
class ModelParameter:
    """One number that model or state depend on.

    ``value`` gives it [SI]; ``changed`` model and state after a change, real or imaginary, in which
    every node keeps its displacement from its own place. ``odd``: the axes whose reversal turns it
    into its opposite.
    """

    value: Callable[[Model, State], float]
    changed: Callable[[Model, State, Any], tuple[Model, State]]
    odd: frozenset[str] = frozenset()


def parameters(model: Model, names: Sequence[str] | None = None) -> dict[str, ModelParameter]:
    """The parameters of a model by name, or those named: film, loads, surroundings and shape."""
    loading = {name: _number(name.split(".")) for name in numbers(model.loading, "loading")
               if isfinite(at(model, name.split(".")))}
    parameters = {name: _number(["specimen", *name.split(".")])
                  for name in film_names(model.specimen)}
    parameters |= {name: _load(name) for name in LOADS} | loading
    parameters |= {name: _length(name.split(".")) for name in shape_names(model.specimen)}
    for name in names or ():
        if name not in parameters:
            raise InputError(f"must be one of {', '.join(parameters)}", key="parameter", given=name)
    return parameters if names is None else {name: parameters[name] for name in names}


def _number(path: Sequence[str]) -> ModelParameter:
    """A number of film, electrode or surroundings; odd along the axis of an arm."""
    return ModelParameter(
        lambda model, state: float(at(model, path)),
        lambda model, state, change: (with_change(model, path, change), state),
        frozenset("xy"[int(path[-1])]) if "arm" in path else frozenset())


def _load(name: Load) -> ModelParameter:
    """The force on the plate [N], the voltage [V] or the gas pressure [Pa]."""
    def value(model: Model, state: State) -> float:
        return float(np.sqrt(state.load(name))) if name == "voltage" else state.load(name)

    def changed(model: Model, state: State, change: Any) -> tuple[Model, State]:
        load = value(model, state) + change
        return model, state.under(**{name: load**2 if name == "voltage" else load})

    return ModelParameter(value, changed)


def _length(path: Sequence[str]) -> ModelParameter:
    """A length of frame, plate or electrode; odd along an offset's axis, or in both if an angle."""
    def changed(model: Model, state: State, change: Any) -> tuple[Model, State]:
        motion = velocity(model.discretisation, model.specimen, tuple(path))
        return moved_by(model, state, with_change(model.specimen, path, change), change * motion)

    odd = "xy"[int(path[-1])] if path[-2] == "offset" else "xy" if path[-1] == "rotation" else ""
    return ModelParameter(lambda model, state: float(at(model.specimen, path)), changed,
                          frozenset(odd))


def film_names(specimen: Specimen) -> tuple[str, ...]:
    """Names of numbers of film and electrode that move nothing, such as membrane.material.mu.0."""
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
