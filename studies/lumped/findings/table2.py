"""What Table 2 says of the lost ε_r and α, and of how ranges grow with the mass."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from studies.lumped.findings.finding import Finding, Number
from studies.lumped.linear import linearise
from studies.lumped.lost import Lost, Ranges
from studies.lumped.model import Actuator
from studies.lumped.published import HIGHEST, MASSES, NAMES, ROUNDING, STEP, SWITCH, ranges

Array = NDArray[np.float64]


def lost_cells(lost: Lost, others: dict[str, Lost], best: Lost, limits: dict[str, tuple[float, float]]) -> Finding:
    """Fits, the smallest worst misfit and what is within twice that."""
    light, heavy = (next(one for one in others.values() if one.rows == (row,)) for row in (0, 1))
    own = next(one for one in others.values() if len(one.rows) == 2)
    (low, high), (first, last) = limits["relative_permittivity"], limits["alpha_1"]
    return Finding(
        "lost", "The lost ε_r and α: what Table 2 allows",
        ("With the paper's cones and Table 1's constants, and Table 2 taken as the way from 0 to 7 kV at rest, "
         f"least squares over its six ranges give ε_r {lost.permittivity:.3f} and α₁ {lost.alpha[0]:.3f} (of the "
         f"circle with the short semi-axis), with {1e3 * lost.rms:.3f} mm left; with an α₁ for each ellipse "
         f"{own.permittivity:.3f}, {own.alpha[0]:.3f} and {own.alpha[1]:.3f}, with {1e3 * own.rms:.3f} mm left.",
         f"No pair reproduces the table within its rounding of ±{1e3 * ROUNDING:g} mm: the smallest possible worst "
         f"misfit is {1e3 * best.worst:.3f} mm, at ε_r {best.permittivity:.3f}, {best.worst / ROUNDING:.0f} times "
         f"that. Within twice it, ε_r may be {low:.2f} to {high:.2f} and α₁ {first:.2f} to {last:.2f}.",
         f"Each mass alone fits well and asks for its own ε_r: {light.permittivity:.2f} under 17.9 g (worst "
         f"{1e3 * light.worst:.3f} mm), {heavy.permittivity:.2f} under 22.45 g (worst {1e3 * heavy.worst:.3f} mm). "
         "What the model cannot do is the step from one mass to the other."),
        (Number("relative permittivity", lost.permittivity), Number("alpha_1", lost.alpha[0]),
         Number("root mean square misfit", lost.rms, "m"),
         Number("relative permittivity, an alpha_1 for each ellipse", own.permittivity),
         Number("alpha_1 of the small ellipse", own.alpha[0]), Number("alpha_1 of the large ellipse", own.alpha[1]),
         Number("smallest worst misfit", best.worst, "m"),
         Number("relative permittivity there", best.permittivity),
         Number("lowest relative permittivity within twice", low),
         Number("highest relative permittivity within twice", high),
         Number("lowest alpha_1 within twice", first), Number("highest alpha_1 within twice", last),
         Number("relative permittivity from 17.9 g alone", light.permittivity),
         Number("relative permittivity from 22.45 g alone", heavy.permittivity)))


def smallest_growth(permittivities: Array, alphas: Array, voltages: Array) -> Array:
    """Smallest ratio of ranges at rest under the two masses over ε_r, α₁ and the upper voltage [V], by actuator."""
    grid = np.meshgrid(permittivities, alphas, indexing="ij")
    found = np.full(len(NAMES), np.inf)
    for voltage in voltages:
        model = Ranges(high=float(voltage))
        for column in range(len(NAMES)):
            moved = [model.rest(column, mass, voltage, *grid)[0] - model.rest(column, mass, 0.0, *grid)[0]
                     for mass in MASSES]
            found[column] = min(found[column], float(np.nanmin(moved[1] / moved[0])))
    return found


def unaccounted(lost: Lost, growth: Array) -> Array:
    """Mass [kg] that would have to hang on the plate beside the stated one for the growth at rest; by actuator."""
    found = []
    for column, wanted in enumerate(growth):
        alpha = lost.weights(column)[0]

        def miss(extra: float, column: int = column, wanted: float = float(wanted), alpha: float = alpha) -> float:
            model = Ranges(unaccounted=extra)
            # The permittivity follows, so that the range under the smaller mass stays what it is.
            def range_(mass: float, permittivity: float) -> float:
                high, low = (model.rest(column, mass, volts, permittivity, alpha)[0] for volts in (HIGHEST, 0.0))
                return float(np.nan_to_num(high - low, nan=1.0))

            target = float(ranges()[0, column])
            permittivity = float(brentq(lambda value: range_(MASSES[0], value) - target, 1.0, 9.9, xtol=1e-9))
            return range_(MASSES[1], permittivity) / target - wanted

        found.append(float(brentq(miss, 0.0, 0.2, xtol=1e-7)))
    return np.array(found)


def mass_ratio(lost: Lost, rest: Array, steps: Array) -> Finding:
    """How ranges grow with the mass: in Table 2, at rest whatever ε_r and α, and over figure 14's steps.

    ``rest`` and ``steps`` are the model's ranges [m], shape (masses, actuators).
    """
    read = ranges()
    growth, at_rest, moving = read[1] / read[0], rest[1] / rest[0], steps[1] / steps[0]
    least = smallest_growth(np.linspace(1.0, 9.5, 35), np.linspace(0.0, 1.0, 11), np.array([1e3, 4e3, HIGHEST]))
    extra = unaccounted(lost, growth)
    left = [[_left(actuator, volts) for volts in (STEP[1], HIGHEST)]
            for mass in MASSES for actuator in lost.actuators(mass)]
    masses, shown = MASSES[1] / MASSES[0], lambda values: " / ".join(f"{value:.3f}" for value in values)
    return Finding(
        "mass", "Table 2's ranges grow less with the mass than films at rest can",
        (f"From 17.9 to 22.45 g the weight grows by {masses:.3f} and Table 2's ranges by {shown(growth)}. At rest "
         f"the model gives {shown(at_rest)}, and no ε_r up to 9.5, α₁ or upper voltage gives less than "
         f"{least.min():.3f}: a film of constant tension moves in proportion to the weight, one that loses stress or "
         "nears pull-in by more.",
         f"Another {' / '.join(f'{1e3 * value:.1f}' for value in extra)} g on the plate, not accounted for, would "
         "give Table 2's growth at rest, for each actuator another mass; a film without prestress, whose force goes "
         f"as y³, would grow by {masses ** (1 / 3):.3f}, still more than the circle did.",
         f"But the model is not at rest after {SWITCH:g} s: by Table 1's viscous constants "
         f"{100 * min(min(left)):.0f} to {100 * max(max(left)):.0f} % of the creep after a small step is then still "
         "to come (3.5 to 7 kV). The branch k₁, stretched more under the larger mass, holds the fast motion back "
         f"by more, and over figure 14's steps the same model grows by {shown(moving)} only. Table 2 lies between "
         "the two, as of a film that is nearer to rest after 30 s than Table 1's k₁ and η₁ make it."),
        (Number("weights", masses),
         *(Number(f"Table 2, {name}", float(value)) for name, value in zip(NAMES, growth, strict=True)),
         *(Number(f"at rest, {name}", float(value)) for name, value in zip(NAMES, at_rest, strict=True)),
         *(Number(f"smallest at rest, {name}", float(value)) for name, value in zip(NAMES, least, strict=True)),
         *(Number(f"over figure 14's steps, {name}", float(value)) for name, value in zip(NAMES, moving, strict=True)),
         *(Number(f"unaccounted mass, {name}", float(value), "kg") for name, value in zip(NAMES, extra, strict=True)),
         Number("film without prestress", masses ** (1 / 3)),
         Number("least share of creep left after 30 s", min(min(left))),
         Number("largest share of creep left after 30 s", max(max(left)))))


def _left(actuator: Actuator, voltage: float) -> float:
    """Share of the slowest motion that is left when figure 14 switches, about rest at a voltage."""
    return float(np.exp(-np.abs(linearise(actuator, voltage).poles[0]) * SWITCH))
