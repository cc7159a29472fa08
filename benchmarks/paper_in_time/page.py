"""The comparison as Markdown."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.paper_in_time.compare import PERIOD, SEEDS, Comparison
from benchmarks.paper_in_time.fit import Constants, Fit
from benchmarks.paper_in_time.step_responses import LONG, ZOOM
from tympan.base.arrays import Array
from tympan.paper import published

_TEXT = (Path(__file__).parent / "page.txt").read_text(encoding="utf-8")


def page(comparison: Comparison) -> str:
    """The page, its words from ``page.txt``."""
    shown, rest, two = comparison.shown, comparison.at_rest, comparison.two
    paper, lumped = published.ranges(), comparison.lumped[SEEDS[0]]
    misfits = np.array([fit.misfit for fit in comparison.in_time.values()])
    loops, settled = comparison.loops, comparison.settled
    longer = settled.times[1].mean() / settled.times[0].mean() - 1
    constants = [fit.constants for fit in comparison.in_time.values()]
    return _TEXT.format(
        ranges=_table(
            ("", *(f"{name}, {1e3 * mass:g} g" for mass in published.MASSES
                   for name in published.NAMES), "left (rms)"),
            [("paper", *_millimetres(paper), ""),
             ("field model at rest, 2 constants", *_millimetres(rest.ranges), _microns(rest)),
             ("in time, one branch, 4 constants", *_millimetres(shown.ranges), _microns(shown)),
             ("in time, two branches, 6 constants", *_millimetres(two.ranges), _microns(two)),
             ("lumped model of cones, ε_r and α₁", *_millimetres(lumped.ranges),
              f"{1e6 * lumped.rms:.0f} µm")]),
        ratios=_table(
            ("", *(f"mass, {name}" for name in published.NAMES),
             *(f"{name}, {1e3 * mass:g} g" for mass in published.MASSES
               for name in published.NAMES[1:])),
            [(words, *_ratios(ranges)) for words, ranges in (
                ("paper", paper), ("at rest", rest.ranges), ("in time", shown.ranges),
                ("two branches", two.ranges), ("lumped", lumped.ranges))]),
        constants=_table(
            ("seed", "µ [kPa]", "ε_r", "branch [MPa]", "time [s]", "left [µm]",
             "by the mass, circle / small / large", "lumped: left [µm]"),
            [(str(seed), *_constants(fit.constants), f"{1e6 * fit.misfit:.0f}",
              " / ".join(f"{ratio:.3f}" for ratio in fit.ranges[1] / fit.ranges[0]),
              f"{1e6 * comparison.lumped[seed].rms:.0f}")
             for seed, fit in comparison.in_time.items()]),
        settling=_table(
            ("", *(f"{name}, {1e3 * mass:g} g" for mass in published.MASSES
                   for name in published.NAMES), "off by (rms)"),
            [("paper", *_seconds(published.SETTLING), ""),
             ("in time", *_seconds(settled.times), f"{settled.rms:.2f}")]),
        **_steps(comparison),
        loops=_table(("actuator", "range [µm]", "widest gap over range [%]"),
                     [(name, f"{1e6 * np.ptp(deflection):.0f}",
                       f"{100 * _gap(voltage, deflection):.1f}")
                      for name, (voltage, deflection) in zip(published.NAMES, loops,
                                                             strict=True)]),
        before=f"{1e6 * rest.misfit:.0f}", least=f"{1e6 * misfits.min():.0f}",
        most=f"{1e6 * misfits.max():.0f}", two=f"{1e6 * two.misfit:.0f}",
        explained=f"{100 * (1 - (misfits.max() / rest.misfit) ** 2):.0f}",
        error=f"{100 * comparison.errors.max():.2f}", damper=f"{comparison.damper:.2f}",
        longer=f"{100 * longer:.0f}", period=f"{PERIOD:g}",
        moduli=_span(1e-3 * each.modulus for each in constants),
        permittivities=_span(each.permittivity for each in constants),
        stiff=_span(1e-6 * each.branches[0].modulus for each in constants),
        slow=_span(each.branches[0].time for each in constants),
        masses=_span(fit.ranges[1] / fit.ranges[0] for fit in comparison.in_time.values()),
        shapes=_span(fit.ranges[:, 2] / fit.ranges[:, 0] for fit in comparison.in_time.values()))


def _steps(comparison: Comparison) -> dict[str, str]:
    """What is said of figures 9 to 12."""
    steps = comparison.steps
    films = {f"film, seed {seed}": moved for seed, moved in steps.in_time.items()}
    every = {**films, "lumped model": steps.lumped}
    soon, late = ({of: steps.after(moved, time) for of, moved in every.items()}
                  for time in (ZOOM, LONG))
    periods = {of: steps.period(moved) for of, moved in every.items()}
    later = {of: 1 - soon[of] / late[of] for of in every}
    cone = late.pop("lumped model")
    first = {of: periods[of][0, 0] for of in every}
    nearest = min(steps.in_time, key=lambda seed: abs(first[f"film, seed {seed}"]
                                                      - first["lumped model"]))
    heads = [f"{name}, {1e3 * mass:g} g" for mass in published.MASSES for name in published.NAMES]
    moved = {**{f"{of}, {LONG:g} s": values for of, values in late.items()},
             f"lumped model, {ZOOM:g} s": soon["lumped model"],
             f"lumped model, {LONG:g} s": cone, "film at rest, for ever": steps.at_rest}
    return {
        "moved": _table(
            ("", *heads, *(f"mass, {name}" for name in published.NAMES),
             *(f"elliptical-large, {1e3 * mass:g} g" for mass in published.MASSES)),
            [(of, *(f"{1e6 * value:.0f}" for value in values.ravel()),
              *(f"{value:.2f}" for value in (*_by_mass(values), *_by_shape(values))))
             for of, values in moved.items()]),
        "periods": _table(("", *heads), [
            (of, *(f"{1e3 * value:.0f}" for value in values.ravel()))
            for of, values in periods.items()]),
        "later": _table(("", *heads), [
            (of, *(f"{100 * value:.0f}" for value in values.ravel()))
            for of, values in later.items()]),
        "long": f"{LONG:g}", "zoom": f"{ZOOM:g}", "stepped": f"{100 * steps.error:.1f}",
        "shape_in_time": _span(map(_by_shape, late.values())),
        "shape_at_rest": f"{_by_shape(steps.at_rest).mean():.3g}",
        "shape_lumped": _span([_by_shape(cone)]),
        "mass_in_time": _span(map(_by_mass, late.values())),
        "mass_at_rest": f"{_by_mass(steps.at_rest).mean():.3g}",
        "mass_soon": _span([_by_mass(soon["lumped model"])]), "mass_late": _span([_by_mass(cone)]),
        "periods_films": _span([np.round(1e3 * first[of]) for of in films]),
        "period_cones": f"{1e3 * first['lumped model']:.0f}",
        "nearest": f"{1e-3 * comparison.in_time[nearest].constants.modulus:.0f}",
        "later_films": _span([np.round(100 * later[of].ravel()) for of in films]),
        "later_cones": _span([np.round(100 * later["lumped model"].ravel())])}


def _by_mass(moved: Array) -> Array:
    """Of the heavier plate over that of the lighter one, by actuators."""
    return np.asarray(moved[1] / moved[0])


def _by_shape(moved: Array) -> Array:
    """Of the large ellipse over that of the circle, by masses."""
    return np.asarray(moved[:, 2] / moved[:, 0])


def _gap(voltage: Array, deflection: Array) -> float:
    """The widest distance between the branches at one voltage, over the range."""
    rising, falling = (_branch(voltage, deflection, sign) for sign in (1, -1))
    low, high = np.quantile(voltage, [0.02, 0.98])
    at = np.linspace(low, high, 200)
    return float(np.abs(np.interp(at, *rising) - np.interp(at, *falling)).max()
                 / np.ptp(deflection))


def _branch(voltage: Array, deflection: Array, sign: int) -> tuple[Array, Array]:
    """Where the voltage rises (1) or falls (-1), by ascending voltage."""
    chosen = sign * np.gradient(voltage) > 0
    order = np.argsort(voltage[chosen])
    return voltage[chosen][order], deflection[chosen][order]


def _millimetres(ranges: Array) -> list[str]:
    return [f"{1e3 * value:.3g}" for value in ranges.ravel()]


def _seconds(times: Array) -> list[str]:
    return [f"{value:.2f}" for value in times.ravel()]


def _microns(fit: Fit) -> str:
    return f"{1e6 * fit.misfit:.0f} µm"


def _ratios(ranges: Array) -> list[str]:
    """Between the masses, and between the ellipses and the circle."""
    shapes = ranges[:, 1:] / ranges[:, :1]
    return [f"{value:.3f}" for value in (*(ranges[1] / ranges[0]), *shapes.ravel())]


def _constants(constants: Constants) -> list[str]:
    branch, = constants.branches
    return [f"{1e-3 * constants.modulus:.1f}", f"{constants.permittivity:.2f}",
            f"{1e-6 * branch.modulus:.2f}", f"{branch.time:.0f}"]


def _span(values: Iterable[Any]) -> str:
    every = np.concatenate([np.atleast_1d(value) for value in values])
    return f"{every.min():.3g} to {every.max():.3g}"


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [f"| {' | '.join(head)} |", "|---|" + "---:|" * (len(head) - 1)]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)])
