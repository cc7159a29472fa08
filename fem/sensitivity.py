"""Exact derivatives of an equilibrium by the specimen's numbers, its load and its voltage.

The residual's derivative by a parameter is a complex step, exact to rounding; the equilibrium follows it through the
tangent, factorised once. So one more parameter costs one evaluation of the forces and, for the adjoint, no solve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Model, Parts
from fem.plate import HEAVE
from fem.state import State
from fem.tangent import Tangent
from geometry.errors import InputError
from geometry.specimen import Specimen

Array = NDArray[np.float64]

_STEP = 1e-40


def parameters(specimen: Specimen) -> tuple[str, ...]:
    """Names of what can be differentiated by: every number of film and electrode, ``force`` and ``voltage``.

    Examples
    --------
    >>> from fem.laws import Ogden
    >>> from geometry.outlines import Circle
    >>> from geometry.specimen import Film, Plate
    >>> film = Film(1e-3, (2.2, 2.2), Ogden((20e3,), (2.0,)), 4.7)
    >>> parameters(Specimen("film", Circle(0.045), Plate(Circle(0.01)), film))[:4]
    ('membrane.thickness', 'membrane.prestretch.0', 'membrane.prestretch.1', 'membrane.material.mu.0')
    """
    film = _numbers(specimen.membrane, "membrane")
    return (*film, "electrode.stiffness", "force", "voltage")


def heave_gradient(model: Model, state: State, names: Sequence[str]) -> dict[str, float]:
    """Derivatives of the heave at constant load and voltage by each named parameter [m per SI unit of it].

    One adjoint solve serves them all.

    Parameters
    ----------
    state
        An equilibrium of the model.
    names
        Of :func:`parameters`.

    Raises
    ------
    InputError
        For a name that is no parameter of the specimen.
    """
    tangent = Tangent(model, model.linearised(state), state)
    free = np.zeros(int(model.free.sum()))
    row = np.zeros(len(model.plate_freedoms))
    row[model.plate_freedoms.index(HEAVE)] = 1.0
    inner, plate = tangent.respond((free, row))
    result = {}
    for name in names:
        by = residual_derivative(model, state, name)
        result[name] = -float(inner @ by[0] + plate @ by[1])
    return result


def residual_derivative(model: Model, state: State, name: str) -> Parts:
    """Derivative of the unbalanced forces (free components, plate) by a parameter at a fixed configuration."""
    if name == "force":
        return model.by_load(state, "force")
    if name == "voltage":
        by = model.by_load(state, "voltage")
        slope = 2 * np.sqrt(state.voltage_squared)
        return slope * by[0], slope * by[1]
    if name not in parameters(model.specimen):
        raise InputError(f"must be one of {', '.join(parameters(model.specimen))}", key="parameter", given=name)
    stepped = model.with_specimen(_stepped(model.specimen, name.split(".")))
    forces = stepped.nodal_forces(state).imag / _STEP
    return forces[model.free], model.plate_forces(forces, state.plate)


def _numbers(value: Any, path: str) -> tuple[str, ...]:
    """Paths of all numbers within a dataclass or tuple."""
    if isinstance(value, float | int):
        return (path,)
    if isinstance(value, tuple):
        return tuple(name for index, item in enumerate(value) for name in _numbers(item, f"{path}.{index}"))
    if is_dataclass(value):
        inner = ((getattr(value, item.name), f"{path}.{item.name}") for item in fields(value))
        return tuple(name for item, below in inner for name in _numbers(item, below))
    return ()


def _stepped(value: Any, path: list[str]) -> Any:
    """A copy with an imaginary step on the number at a path."""
    if not path:
        return value + 1j * _STEP
    if isinstance(value, tuple):
        index = int(path[0])
        return (*value[:index], _stepped(value[index], path[1:]), *value[index + 1 :])
    return replace(value, **{path[0]: _stepped(getattr(value, path[0]), path[1:])})
