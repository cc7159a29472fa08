"""Weights α of the circular actuators that stand for a shape in the lumped model (Eqs. (5), (6), N = 2)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from fem.fields import edge_fields, reaction, whole
from fem.loading import Loading
from fem.model import Model
from fem.newton import Solution
from fem.paths import held, voltage_path
from fem.rig import Rig
from fem.state import State
from geometry.errors import InputError
from geometry.outlines import Circle
from geometry.specimen import Plate, Specimen
from studies.cases import Settings, build_model, why
from studies.cone import ConeCircle

Array = NDArray[np.float64]
Basis = Literal["membrane", "cone", "cone_scaled"]
Progress = Callable[[str], None]


@dataclass(frozen=True)
class LoadGrid:
    """Masses [kg] and voltages [V], every combination."""

    masses: tuple[float, ...]
    voltages: tuple[float, ...]


@dataclass(frozen=True)
class AlphaSettings:
    """Loads the weights are fitted on and loads they are tested on.

    The defaults fit on the paper's masses at 0 to 5 kV and test at other masses, from lighter to heavier, and other
    voltages, from between to beyond.
    """

    fit: LoadGrid = field(default_factory=lambda: LoadGrid((17.9e-3, 22.45e-3), (0.0, 1e3, 2e3, 3e3, 4e3, 5e3)))
    held_out: LoadGrid = field(default_factory=lambda: LoadGrid((12e-3, 20e-3, 25e-3), (2.5e3, 4.5e3, 5.5e3)))


@dataclass(frozen=True)
class Weights:
    """α of one way of finding it, with the relative root-mean-square error of the force it leaves.

    ``fit_error`` is on the loads used for fitting, ``held_out_error`` on the others (None where none is in reach).
    """

    alpha: tuple[float, ...]
    fit_error: float
    held_out_error: float | None


@dataclass(frozen=True)
class AlphaResult:
    """α of a specimen for circles of the given radii [m], the shortest first.

    ``by_basis`` holds the fits against membrane circles, against cones as the paper writes them, and against cones
    whose force is multiplied by ``cone_scale``, the ratio of membrane to cone on the first circle.
    """

    specimen: str
    circles: tuple[float, ...]
    by_basis: dict[Basis, Weights]
    cone_scale: float
    from_fields: Weights
    field_range: tuple[tuple[float, float], ...]
    warnings: tuple[str, ...]

    def json(self, basis: Basis = "membrane") -> dict[str, Any]:
        """The object of ``alpha --json`` (design §6) for one basis."""
        weights = self.by_basis[basis]
        return {
            "specimen": self.specimen,
            "circles": list(self.circles),
            "alpha": list(weights.alpha),
            "basis": basis,
            "fit_error": weights.fit_error,
            "held_out_error": weights.held_out_error,
            "from_fields": {
                "alpha": list(self.from_fields.alpha),
                "fit_error": self.from_fields.fit_error,
                "held_out_error": self.from_fields.held_out_error,
                "range": [list(pair) for pair in self.field_range],
            },
            "cone_scale": self.cone_scale,
            "warnings": list(self.warnings),
        }


@dataclass(frozen=True, eq=False)
class _Samples:
    """Equilibria of a specimen: force on the film [N], deflection [m], voltage across the film [V], sector shares."""

    force: Array
    deflection: Array
    voltage: Array
    shares: Array


def alpha(specimen: Specimen, settings: Settings, alpha_settings: AlphaSettings = AlphaSettings(),
          rig: Rig = Rig(), progress: Progress = lambda _: None) -> AlphaResult:
    """Weights of the two circles with the short and the long semi-axis.

    Three fits of Σ α_j F_j(y, U) to the specimen's own force at its equilibria, all with α ≥ 0 and Σ α = 1: F_j of
    membrane circles by the same finite elements, of straight cones (Eq. 5), and of cones scaled to the membrane on
    the first circle. Independently, from the fields: the share of the plate's vertical edge force carried by the
    sectors within 45° of the short axis and of the long axis, averaged over the fit's loads.

    A shape with equal semi-axes is one circle, α = (1).

    Raises
    ------
    InputError
        When no load of the fit has an equilibrium.
    """
    short, long = sorted(specimen.frame.semi_axes)
    radii = (short, long) if long > short * (1 + 1e-9) else (short,)
    model = build_model(specimen, settings, rig.loading)
    warnings: list[str] = []
    progress(f"{specimen.name}: equilibria")
    fit = _equilibria(model, alpha_settings.fit, rig, settings, len(radii), warnings)
    test = _equilibria(model, alpha_settings.held_out, rig, settings, len(radii), warnings)
    if not len(fit.force):
        raise InputError("has no equilibrium at any load of the fit", key="alpha", given=specimen.name)
    progress(f"{specimen.name}: circles")
    circles = [_circle_model(specimen, radius, settings, rig.loading) for radius in radii]
    cones = [ConeCircle(specimen, radius) for radius in radii]
    membrane = [_membrane_forces(circles, samples, settings) for samples in (fit, test)]
    cone = [_cone_forces(cones, samples) for samples in (fit, test)]
    scale = float(membrane[0][:, 0] @ cone[0][:, 0] / (cone[0][:, 0] @ cone[0][:, 0]))
    bases: dict[Basis, list[Array]] = {
        "membrane": membrane, "cone": cone, "cone_scaled": [scale * forces for forces in cone]}
    by_basis = {name: _weigh(simplex_fit(forces[0], fit.force), forces, fit, test) for name, forces in bases.items()}
    shares = fit.shares.mean(axis=0)
    spread = tuple((float(low), float(high)) for low, high in zip(fit.shares.min(0), fit.shares.max(0), strict=True))
    return AlphaResult(specimen.name, radii, by_basis, scale, _weigh(shares, membrane, fit, test), spread,
                       tuple(warnings + _doubts(specimen, by_basis, radii)))


def simplex_fit(forces: Array, target: Array) -> Array:
    """The α ≥ 0, Σ α = 1 that minimises |forces · α − target|, exactly.

    For every choice of circles with non-zero weight the equality-constrained problem has a closed form; the best
    feasible one is the minimum. ``forces`` has shape (samples, circles).

    Examples
    --------
    >>> forces = np.array([[2.0, 1.0], [4.0, 2.5]])
    >>> simplex_fit(forces, forces @ [0.3, 0.7]).round(12).tolist()
    [0.3, 0.7]
    >>> simplex_fit(forces, np.array([9.0, 9.0])).tolist()
    [1.0, 0.0]
    """
    count = forces.shape[1]
    best, least = np.full(count, 1 / count), np.inf
    for size in range(1, count + 1):
        for chosen in map(list, combinations(range(count), size)):
            weights = np.zeros(count)
            base = forces[:, chosen[0]]
            rest = forces[:, chosen[1:]] - base[:, None]
            others = np.linalg.lstsq(rest, target - base, rcond=None)[0] if size > 1 else np.zeros(0)
            weights[chosen[1:]] = others
            weights[chosen[0]] = 1 - others.sum()
            misfit = float(np.linalg.norm(forces @ weights - target))
            if weights.min() >= 0 and misfit < least:
                best, least = weights, misfit
    return best


def sector_shares(model: Model, state: State) -> Array:
    """Shares of the plate's vertical edge force carried within 45° of the short axis and of the long axis.

    The force is the integral of the first Piola traction along the mounted edge; angles are those of the mounted edge
    around the plate's centre. If the semi-axes are equal, x counts as the short one.
    """
    full, unfolded = whole(model, state)
    edge = edge_fields(full, unfolded, "plate", 24, quadrature=True)
    arm = edge.fields.position - full.centre
    angle = np.arctan2(arm[:, 1], arm[:, 0]) % (2 * np.pi)
    order = np.argsort(angle)
    force = (edge.fields.plate_traction[:, 2] * edge.weights)[order]
    # Midpoint rule of the cumulative force, so that a sector may end between two points of an edge.
    cumulative = np.cumsum(force) - force / 2
    cuts = np.interp(np.pi / 4 + np.pi / 2 * np.arange(4), angle[order], cumulative)
    along_y = (cuts[1] - cuts[0] + cuts[3] - cuts[2]) / force.sum()
    a, b = model.specimen.frame.semi_axes
    return np.array([along_y, 1 - along_y]) if b < a else np.array([1 - along_y, along_y])


def _equilibria(model: Model, loads: LoadGrid, rig: Rig, settings: Settings, circles: int, warnings: list[str]
                ) -> _Samples:
    rows: list[tuple[float, float, float]] = []
    shares: list[Array] = []
    for mass in loads.masses:
        seen = [rig.film_voltage(voltage) for voltage in loads.voltages]
        for outcome in voltage_path(model, rig.force(mass, model.plate_area), seen, rig.gas_pressure, settings.path):
            state = outcome.state
            if outcome.status != "equilibrium":
                warnings.append(f"{mass * 1e3:g} g: {why(outcome)}; loads beyond are left out")
                break
            if state.plate.heave <= 1e-6 * model.size:
                warnings.append(f"{mass * 1e3:g} g: the plate hardly sinks; this load is left out")
                break
            rows.append((reaction(model, state), state.plate.heave,
                         float(np.sqrt(state.voltage_squared))))
            shares.append(sector_shares(model, state) if circles == 2 else np.ones(1))
    force, deflection, voltage = np.array(rows).reshape(-1, 3).T
    return _Samples(force, deflection, voltage, np.array(shares).reshape(-1, circles))


def _circle_model(specimen: Specimen, radius: float, settings: Settings, loading: Loading) -> Model:
    """The circular specimen of a radius with the same film, electrode and plate, its plate in the middle."""
    try:
        circle = replace(specimen, name=f"circle {radius * 1e3:g} mm", frame=Circle(radius),
                         plate=Plate(specimen.plate.outline))
    except InputError as error:
        raise InputError(f"has no circle of radius {radius * 1e3:g} mm to compare with: {error.allowed}", key="alpha",
                         given=specimen.name) from None
    return build_model(circle, settings, loading)


def _membrane_forces(circles: list[Model], samples: _Samples, settings: Settings) -> Array:
    """Force [N] of each circle held at each sample's deflection and voltage, shape (samples, circles)."""
    columns = []
    for model in circles:
        column, start = [], None
        for deflection, voltage in zip(samples.deflection, samples.voltage, strict=True):
            outcome = held(model, deflection, voltage, start, settings.path)
            start = _usable(outcome.solution)
            column.append(outcome.state.force if outcome.status == "equilibrium" else np.nan)
        columns.append(column)
    forces = np.array(columns).reshape(len(circles), -1).T
    if np.isnan(forces).any():
        raise InputError("a circle of this size cannot follow the specimen's deflection", key="alpha")
    return forces


def _usable(solution: Solution) -> Solution | None:
    return solution if solution.converged else None


def _cone_forces(cones: list[ConeCircle], samples: _Samples) -> Array:
    rows = [[cone.force(y, u) for cone in cones] for y, u in zip(samples.deflection, samples.voltage, strict=True)]
    return np.array(rows).reshape(-1, len(cones))


def _weigh(weights: Array, forces: Iterable[Array], fit: _Samples, test: _Samples) -> Weights:
    errors = [_error(part @ weights, samples.force) for part, samples in zip(forces, (fit, test), strict=True)]
    fit_error = errors[0]
    assert fit_error is not None
    return Weights(tuple(float(weight) for weight in weights), fit_error, errors[1])


def _error(modelled: Array, actual: Array) -> float | None:
    if not len(actual):
        return None
    return float(np.linalg.norm(modelled - actual) / np.linalg.norm(actual))


def _doubts(specimen: Specimen, by_basis: dict[Basis, Weights], radii: tuple[float, ...]) -> list[str]:
    """What stands between these weights and their use."""
    if len(radii) == 1 and isinstance(specimen.plate.outline, Circle) and specimen.plate.offset == (0.0, 0.0):
        return ["the semi-axes are equal: the shape is one circle and α is 1"]
    if len(radii) == 1:
        return [f"the frame is one circle and α is 1, but the plate is not a circle in its middle: the force is "
                f"{100 * by_basis['membrane'].fit_error:.1f} % off"]
    doubts = []
    names: dict[Basis, str] = {"membrane": "membrane circles", "cone": "cones as in Eq. (5)",
                               "cone_scaled": "cones scaled to the membrane"}
    for basis, words in names.items():
        weights = by_basis[basis]
        if min(weights.alpha) == 0 and weights.fit_error > 0.02:
            doubts.append(f"{words}: no mixture fits, α sits at its bound and leaves a force error of "
                          f"{100 * weights.fit_error:.0f} %")
    return doubts
