"""What Table 2 says of the lost ε_r and α, and of how ranges grow with the mass."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from tympan.studies.lumped.linear import linearise
from tympan.studies.paper.published import HIGHEST, MASSES, NAMES, ROUNDING, STEP, SWITCH, ranges
from tympan.studies.replica.findings.finding import Finding, evidence
from tympan.studies.replica.missing_parameters import MissingParameters, rest_ranges
from tympan.studies.replica.words import sentences

Array = NDArray[np.float64]
_ALIKE = 0.03  # two growths with ranges rounded to 0.01 mm are alike within it


def lost_cells(missing: MissingParameters, others: dict[str, MissingParameters],
               best: MissingParameters, limits: dict[str, tuple[float, float]],
               levels: MissingParameters) -> Finding:
    """Fits at rest, the smallest worst misfit, what is within twice that, the fit of the levels."""
    light, heavy = (next(fit for fit in others.values() if fit.rows == (row,)) for row in (0, 1))
    each = next(fit for fit in others.values() if len(fit.rows) == 2)
    (low, high), (first, last) = limits["relative_permittivity"], limits["alpha_1"]
    ellipses, circle = 1e3 * np.abs(levels.misfit[:, 1:]).max(), 1e3 * levels.misfit[:, 0]
    return Finding(
        "lost", "The lost ε_r and α: what Table 2 allows",
        sentences("lost", rest=missing, each=each, best=best, levels=levels, light=light,
                  heavy=heavy, rounding_mm=1e3 * ROUNDING, times=best.worst / ROUNDING,
                  permittivity=(low, high), alpha=(first, last), ellipses_mm=ellipses,
                  circle_mm=circle),
        (evidence("relative permittivity, at rest", missing.permittivity),
         evidence("alpha_1, at rest", missing.alpha[0]),
         evidence("root mean square misfit, at rest", missing.rms, "m"),
         evidence("relative permittivity, an alpha_1 for each ellipse", each.permittivity),
         evidence("alpha_1 of the small ellipse", each.alpha[0]),
         evidence("alpha_1 of the large ellipse", each.alpha[1]),
         evidence("smallest worst misfit", best.worst, "m"),
         evidence("relative permittivity there", best.permittivity),
         evidence("lowest relative permittivity within twice", low),
         evidence("highest relative permittivity within twice", high),
         evidence("lowest alpha_1 within twice", first),
         evidence("highest alpha_1 within twice", last),
         evidence("relative permittivity from 17.9 g alone", light.permittivity),
         evidence("relative permittivity from 22.45 g alone", heavy.permittivity),
         evidence("relative permittivity, ends of levels", levels.permittivity),
         evidence("alpha_1, ends of levels", levels.alpha[0]),
         evidence("root mean square misfit, ends of levels", levels.rms, "m"),
         evidence("worst misfit of an ellipse, ends of levels", 1e-3 * ellipses, "m")))


def smallest_growth(permittivities: Array, alphas: Array, voltages: Array) -> Array:
    """Smallest ratio of ranges at rest under the two masses, by actuator.

    Over ε_r, α₁ and the upper voltage [V].
    """
    grid, alpha = np.meshgrid(permittivities, alphas, indexing="ij")
    growths = []
    for voltage in voltages:
        light, heavy = np.moveaxis(rest_ranges(grid, np.stack([alpha, alpha], -1), voltage), -2, 0)
        growths.append(np.nanmin(heavy / light, axis=(0, 1)))
    return np.asarray(np.min(growths, axis=0))


def unaccounted(missing: MissingParameters, growth: Array) -> Array:
    """Mass [kg] beside the stated one on the plate for the growth at rest; by actuator."""
    extras = []
    for column, target in enumerate(ranges()[0].tolist()):
        def moved(row: int, extra: float, permittivity: float, column: int = column) -> float:
            ours = rest_ranges(permittivity, missing.alpha, masses=(MASSES[row] + extra,))
            return float(np.nan_to_num(ours[0, column], nan=1.0))

        def miss(extra: float, column: int = column, target: float = target,
                 moved: Any = moved) -> float:
            # The permittivity follows, so that the range under the smaller mass stays what it is.
            permittivity = float(brentq(lambda value: moved(0, extra, value) - target, 1.0, 9.9,
                                        xtol=1e-9))
            return float(moved(1, extra, permittivity) / target - growth[column])

        extras.append(float(brentq(miss, 0.0, 0.2, xtol=1e-7)))
    return np.array(extras)


def mass_ratio(missing: MissingParameters, rest: Array, levels: Array, whole: Array) -> Finding:
    """How ranges grow with the mass: in Table 2, at rest whatever ε_r and α, and over steps.

    ``rest``, ``levels`` and ``whole`` are the model's ranges [m] at rest, at the ends of figure
    14's levels and of all samples, shape (masses, actuators).
    """
    growth, at_rest, at_ends, moving = (heavy / light for light, heavy
                                        in (ranges(), rest, levels, whole))
    least = smallest_growth(np.linspace(1.0, 11.0, 41), np.linspace(0.0, 1.0, 11),
                            np.array([1e3, 4e3, HIGHEST]))
    extra = unaccounted(missing, growth)
    # Share of the slowest motion, about rest at a voltage, that is there when figure 14 switches.
    remaining = [float(np.exp(-np.abs(linearise(actuator, volts).poles[0]) * SWITCH))
                 for volts in (STEP[1], HIGHEST)
                 for mass in MASSES for actuator in missing.actuators(mass)]
    masses, cubic = MASSES[1] / MASSES[0], (MASSES[1] / MASSES[0]) ** (1 / 3)
    alike = np.abs(at_ends - growth) < _ALIKE
    odd = ""
    if alike.tolist() == [False, True, True]:
        odd = " " + sentences("mass, odd")[0]
    return Finding(
        "mass", "Table 2's ranges grow less with the mass than films at rest can",
        sentences("mass", masses=masses, growth=_listed(growth), at_rest=_listed(at_rest),
                  least=least.min(), extra_g=_listed(1e3 * extra, 1), cubic=cubic,
                  remaining=(100 * min(remaining), 100 * max(remaining)),
                  at_ends=_listed(at_ends), moving=_listed(moving), odd=odd),
        (evidence("weights", masses),
         *(evidence(f"{what}, {name}", float(value)) for what, values in (
             ("Table 2", growth), ("at rest", at_rest), ("smallest at rest", least),
             ("ends of levels", at_ends), ("all samples", moving))
           for name, value in zip(NAMES, values, strict=True)),
         *(evidence(f"unaccounted mass, {name}", float(value), "kg")
           for name, value in zip(NAMES, extra, strict=True)),
         evidence("film without prestress", cubic),
         evidence("least share of creep left after 30 s", min(remaining)),
         evidence("largest share of creep left after 30 s", max(remaining))))


def _listed(values: Array, digits: int = 3) -> str:
    return " / ".join(f"{value:.{digits}f}" for value in values)
