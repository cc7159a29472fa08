"""A lumped model as C99 for a controller: rates of its state, deflection, capacitance.

The film's forces are exported as series in y² for any law, so the C code needs only the model's
numbers.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from tympan.base.arrays import Array
from tympan.base.errors import Failure, InputError
from tympan.studies.files import write_text
from tympan.studies.lumped.model_file import LumpedModel

#: Largest error of a series, relative to the largest value.
TOLERANCE = 1e-12
#: Degrees of the series, tried in this order.
_DEGREES = (12, 24, 48, 96)


def export_c(model: LumpedModel, folder: Path) -> list[Path]:
    """Write ``NAME.h`` and ``NAME.c``, whose functions are named after the specimen.

    Raises
    ------
    Failure
        Where no series follows the film up to the model's reach.
    InputError
        Where the model's film has viscous branches of its own.
    """
    if model.film is not None:
        raise InputError("must have [viscous]: the reduced film of a specimen with branches of its "
                         "own is not exported", key="film", given=model.specimen.name)
    name = identifier(model.specimen.name)
    words = _words(model, name)
    files = []
    for kind, text in (("h", "header"), ("c", "source")):
        template = resources.files("tympan.studies.lumped.export").joinpath(f"{text}.txt")
        file = folder / f"{name}.{kind}"
        write_text(file, Template(template.read_text(encoding="utf-8")).substitute(words))
        files.append(file)
    return files


def _words(model: LumpedModel, name: str) -> dict[str, Any]:
    actuator = model.actuator(mass=1.0)  # the C functions take the actual mass
    reach = min(actuator.reach, float(1 / np.min(actuator.circles.steepness)))
    parts: dict[str, Callable[[Array], Array]] = {
        "film": lambda y: actuator.elastic(y)[1] / y,
        "electric": lambda y: actuator.electric(y)[1] / y, "capacitance": actuator.capacitance}
    series = {part: even_series(function, reach) for part, function in parts.items()}
    viscous = actuator.viscous
    return {
        "title": model.specimen.name, "name": name, "prefix": name.upper(),
        "states": 2 + actuator.count, "reach": repr(reach),
        "highest": repr(float(model.highest_voltage)),
        "error": f"{max(error for _, error in series.values()):.1g}",
        "length": _numbers(1 / actuator.circles.steepness),
        "volume": _numbers(np.array(actuator.weights) * actuator.circles.volume),
        "k1": repr(float(viscous.k1)), "eta1": repr(float(viscous.eta1)),
        "eta2": repr(float(viscous.eta2)), "gravity": repr(actuator.rig.gravity),
        **{part: _numbers(coefficients) for part, (coefficients, _) in series.items()}}


def even_series(function: Callable[[Array], Array], reach: float) -> tuple[Array, float]:
    """Fit Chebyshev coefficients in t = 2 (y/reach)² − 1 to an even function; find the error.

    The error is relative to the largest value, measured between the interpolation points.
    """
    def of(t: Array) -> Array:
        return function(reach * np.sqrt((1 + t) / 2))

    between = np.cos(np.linspace(0, np.pi, 1000)[1:-1])
    values = of(between)
    for degree in _DEGREES:
        coefficients = np.real(chebyshev.Chebyshev.interpolate(of, degree).coef).astype(float)
        misses = np.abs(chebyshev.chebval(between, coefficients) - values)
        error = float(misses.max() / max(np.abs(values).max(), np.finfo(float).tiny))
        if error < TOLERANCE:
            return coefficients, error
    raise Failure(f"no series of degree {degree} follows the film up to {reach * 1e3:.3g} mm: it "
                  f"misses {error:.1g} of the largest force")


def identifier(name: str) -> str:
    """Turn a name into an identifier that C allows."""
    text = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return text if text[0].isalpha() else f"model_{text}"


def _numbers(values: Iterable[Any]) -> str:
    return ", ".join(repr(float(value)) for value in values)
