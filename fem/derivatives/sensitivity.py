"""Exact derivatives of scalar results by material, film, electrode, loads, surroundings and shape.

A quantity q of an equilibrium R(u, p) = 0, u the displacements of nodes and plate, changes with a
parameter p by dq/dp = ∂q/∂p − λ·∂R/∂p, the tangent being K and K λ = ∂q/∂u (adjoint method; Choi &
Kim, *Structural Sensitivity Analysis and Optimization*, 2005). One back-substitution into the
solver's factors serves all parameters. Both partial derivatives are complex steps, exact to
rounding. Only the effect of lengths on the forces is read off the forces of λ
(:mod:`tympan.fem.derivatives.residual_derivative`).

Newton's factors belong to an iterate some 1e-4 of the frame's extent before the equilibrium.
Iterative refinement with the equilibrium's own tangent needs no factors and gains three digits a
step.

A parameter changes model and state by a real or an imaginary step. So the same few lines serve the
complex step and the finite differences that check it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import isfinite
from typing import Any

import numpy as np

from tympan.base.errors import InputError
from tympan.base.paths import at, numbers, with_change
from tympan.fem.complex_step import STEP
from tympan.fem.derivatives.quantities import Functional, firmness_at
from tympan.fem.derivatives.residual_derivative import ResidualDerivative, Stiffness
from tympan.fem.derivatives.shape import lengthened, moved_by, velocity
from tympan.fem.equilibrium.arc_segment import PathPoint
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.subspace import FULL
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.membrane.loading import Loading
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import Load, State
from tympan.fem.results.firmness import firmness, spot_at
from tympan.geometry.specimen import Specimen

#: Loads by name: node positions stay, the load changes.
LOAD_NAMES: tuple[Load, ...] = ("force", "voltage", "pressure")

#: Relative error of an adjoint solution: a tenth of the error allowed in equilibria.
_EXACT = 1e-8
_REFINEMENTS = 12

#: Change of the load, relative to it, per arc length over the frame's half extent; a point with a
#: smaller change is a limit.
_FOLD = 1e-2


@dataclass(frozen=True)
class ModelParameter:
    """One number that model or state depend on.

    ``value`` gives it [SI]; ``changed`` gives model and state after a real or imaginary change, in
    which every node keeps its displacement from its own place. ``odd`` lists the axes whose
    reversal changes the sign of the parameter.
    """

    value: Callable[[Model, State], float]
    changed: Callable[[Model, State, Any], tuple[Model, State]]
    odd: frozenset[str] = frozenset()


def parameters(model: Model, names: Sequence[str] | None = None) -> dict[str, ModelParameter]:
    """Find parameters of a model by name, by default all: film, loads, surroundings and shape."""
    makers: dict[Any, Callable[[Any], ModelParameter]] = {
        **dict.fromkeys(film_names(model.specimen), _of_film), **dict.fromkeys(LOAD_NAMES, _load),
        **dict.fromkeys(_loading_names(model.loading), _number),
        **dict.fromkeys(shape_names(model.specimen), _length)}
    for name in names or ():
        if name not in makers:
            raise InputError(f"must be one of {', '.join(makers)}", key="parameter", given=name)
    return {name: makers[name](name) for name in (makers if names is None else names)}


@lru_cache(maxsize=64)
def _loading_names(loading: Loading) -> tuple[str, ...]:
    return tuple(name for name in numbers(loading, "loading")
                 if isfinite(at(loading, name.split(".")[1:])))


#: Names of pairs whose parts change sign in a mirror image.
_ODD = {"arm", "thickness_gradient", "centre"}


def _of_film(name: str) -> ModelParameter:
    return _number(f"specimen.{name}")


def _number(name: str) -> ModelParameter:
    """Make a parameter of a number at a path; odd along the axis of a pair of :data:`_ODD`."""
    path = name.split(".")
    return ModelParameter(
        lambda model, state: float(at(model, path)),
        lambda model, state, change: (with_change(model, path, change), state),
        frozenset("xy"[int(path[-1])]) if _ODD & set(path) else frozenset())


def _load(name: Load) -> ModelParameter:
    def value(model: Model, state: State) -> float:
        return float(np.sqrt(state.load(name))) if name == "voltage" else state.load(name)

    def changed(model: Model, state: State, change: Any) -> tuple[Model, State]:
        load = value(model, state) + change
        return model, state.under(**{name: load**2 if name == "voltage" else load})

    return ModelParameter(value, changed)


def _length(name: str) -> ModelParameter:
    """Make a parameter of a length; odd along an offset's axis, or along both if an angle."""
    path = tuple(name.split("."))

    def changed(model: Model, state: State, change: Any) -> tuple[Model, State]:
        parts, specimen = _images(model, path), model.specimen
        for other, share in parts:
            specimen = lengthened(specimen, other, share * change)
        if not model.meshed:
            return replace(model, specimen=specimen), state
        motion = sum(share * velocity(model.discretisation, model.specimen, other)
                     for other, share in parts)
        return moved_by(model, state, specimen, change * motion)

    odd = ""
    if path[-2] == "offset":
        odd = "xy"[int(path[-1])]
    elif path[-1] == "rotation":
        odd = "xy"
    return ModelParameter(lambda model, state: float(at(model.specimen, path)), changed,
                          frozenset(odd))


def _images(model: Model, path: Sequence[str]) -> list[tuple[tuple[str, ...], float]]:
    """List the lengths that change with one of a mirrored film, each with its share in the change.

    The edge of one segment, moved alone, breaks the mirror symmetry. What is equal for mirror
    images then changes as if its images moved, too, and each by an equal share.
    """
    found = {tuple(path): 1.0}
    if tuple(path[:2]) != ("electrode", "segments"):
        return [*found.items()]
    for plane in sorted(model.discretisation.planes):
        mean: dict[tuple[str, ...], float] = {}
        for here, share in found.items():
            there, sign = model.specimen.electrode.image(here[1:], plane)
            for other, part in ((here, share), (("electrode", *there), sign * share)):
                mean[other] = mean.get(other, 0.0) + part / 2
        found = mean
    return [*found.items()]


@lru_cache(maxsize=64)
def film_names(specimen: Specimen) -> tuple[str, ...]:
    """List the numbers of film and electrode that move nothing, such as membrane.material.mu.0."""
    # Strength affects only breakdown.
    return (*numbers(replace(specimen.membrane, strength=None), "membrane"), "electrode.stiffness",
            "electrode.mass", *numbers(specimen.electrode.patches, "electrode.patches"),
            *(f"electrode.segments.{number}.share"
              for number in range(len(specimen.electrode.segments))))


@lru_cache(maxsize=64)
def shape_names(specimen: Specimen) -> tuple[str, ...]:
    """List the lengths of frame and plate, and of an electrode with edges within the film.

    Corners and points of a drawn outline are among them if the specimen has no mirror plane.
    """
    electrode = specimen.electrode
    margins = (f"electrode.{name}" for name in ("margin_frame", "margin_plate")
               if getattr(electrode, name) > 0)
    names = (*numbers(specimen.frame, "frame"), *numbers(specimen.plate, "plate"), *margins,
             *numbers(electrode.outline, "electrode.outline"),
             *(("electrode.gap",) if electrode.gap > 0 else ()),
             *(f"electrode.{name}" for name in electrode.edge_names))
    # Moving one corner alone would break a mirror symmetry that the model may use.
    drawn = {"vertices", "through"} if specimen.mirror_planes else set()
    return tuple(name for name in names if drawn.isdisjoint(name.split(".")))


def gradient(model: Model, equilibrium: Outcome | Solution | State, quantity: Functional,
             names: Sequence[str]) -> dict[str, float]:
    """Differentiate a quantity at constant loads by named parameters [SI unit per SI unit].

    An outcome or a solution brings its factors; a bare state is factorised anew. The names are
    those of :func:`~tympan.fem.derivatives.sensitivity.parameters`. InputError for any other name,
    and for quantities that have no derivative there.
    """
    return gradient_many(model, equilibrium, {"": quantity}, parameters(model, names))[""]


def gradient_many(model: Model, equilibrium: Outcome | Solution | State,
                  quantities: Mapping[str, Functional],
                  by: Mapping[str, ModelParameter]) -> dict[str, dict[str, float]]:
    """Differentiate named quantities by named parameters; one adjoint solve per quantity."""
    if isinstance(equilibrium, Outcome) and equilibrium.status != "equilibrium":
        raise InputError("has no derivatives: no equilibrium was found", key="state",
                         given=equilibrium.advice)
    state = equilibrium if isinstance(equilibrium, State) else equilibrium.state
    stiffness, nearby = Stiffness(model, state), nearby_tangent(model, equilibrium)
    motions = [solve_adjoint(stiffness, nearby, quantity.slope(model, state))
               for quantity in quantities.values()]
    residual = ResidualDerivative(stiffness, motions)
    result: dict[str, dict[str, float]] = {name: {} for name in quantities}
    for name, parameter in by.items():
        # A quantity is equal for mirror images, so its derivative by an odd parameter is zero.
        if parameter.odd & model.discretisation.planes:
            for slopes in result.values():
                slopes[name] = 0.0
            continue
        stepped = parameter.changed(model, state, 1j * STEP)
        shares = residual.by(*stepped)
        for (label, quantity), share in zip(quantities.items(), shares, strict=True):
            result[label][name] = float((quantity.value(*stepped).imag - share) / STEP)
    return result


def nearby_tangent(model: Model, equilibrium: Outcome | Solution | State) -> Tangent:
    """Take a solution's factors if they are for all motions of this model; else factorise anew."""
    if isinstance(equilibrium, State):
        return Tangent(model, model.linearised(equilibrium), equilibrium)
    solution = equilibrium.solution if isinstance(equilibrium, Outcome) else equilibrium
    tangent = solution.tangent
    if tangent and tangent.subspace is FULL and tangent.model.unknowns == model.unknowns:
        return tangent
    return nearby_tangent(model, solution.state)


def solve_adjoint(stiffness: Stiffness, nearby: Tangent, right: Parts) -> Parts:
    """Solve K λ = ∂q/∂u; refine until the next correction is negligible or no longer shrinks."""
    solution = nearby.respond(right)
    size = last = _extent(solution)
    for _ in range(_REFINEMENTS):
        product = stiffness.product(solution)
        more = nearby.respond((right[0] - product[0], right[1] - product[1]))
        length = _extent(more)
        if not length < last:
            break
        solution = solution[0] + more[0], solution[1] + more[1]
        # The next correction is expected to shrink in the same proportion.
        if length * length <= _EXACT * size * last:
            break
        last = length
    return solution


def limit_gradient(model: Model, critical: PathPoint, load: Load,
                   by: Mapping[str, ModelParameter]) -> dict[str, float]:
    """Differentiate a limit load, such as the U² of pull-in [V²], by parameters.

    At a limit point the tangent has a null vector φ, the critical mode, so that dλ/dp = −φ·∂R/∂p /
    φ·∂R/∂λ: no solve. The point and its load are such as ``critical`` and ``limited`` of an
    :class:`~tympan.fem.equilibrium.ramp.Outcome`. InputError where the load has no limit, such as
    at a bifurcation.
    """
    state, mode = critical.state, critical.direction
    if abs(critical.rate) > _FOLD * abs(state.load(load)):
        raise InputError("has no derivatives: the load has no smooth limit there", key="limit",
                         given=load)
    residual = ResidualDerivative(Stiffness(model, state), [mode])
    loads: dict[str, Any] = {load: state.load(load) + 1j * STEP}
    share = residual.by(model, state.under(**loads))[0]
    result = {}
    for name, parameter in by.items():
        if parameter.odd & model.discretisation.planes:
            result[name] = 0.0
        elif name == load:
            raise InputError("is the load that has the limit", key="parameter", given=name)
        else:
            stepped = parameter.changed(model, state, 1j * STEP)
            result[name] = float(-residual.by(*stepped)[0] / share)
    return result


def thinning_gradient(model: Model, critical: PathPoint, load: Load,
                      by: Mapping[str, ModelParameter]) -> dict[str, float]:
    """Differentiate the load, U² of a voltage, at which a film becomes unstable locally.

    Its firmness stays zero at that spot. Arguments are those of :func:`limit_gradient`.
    """
    state, parameter = critical.state, _load(load)
    spot = spot_at(model, state, int(np.argmin(firmness(model, state))))
    slopes = gradient_many(model, critical.solution, {"": firmness_at(spot)},
                           {**by, load: parameter})[""]
    scale = 2 * parameter.value(model, state) if load == "voltage" else 1.0
    by_load = slopes.pop(load) / scale
    return {name: -slope / by_load for name, slope in slopes.items()}


def _extent(motion: Parts) -> float:
    return max(float(np.abs(part).max(initial=0.0)) for part in motion)
