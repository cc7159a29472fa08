"""Bands: spread of a result between films made to the tolerances, at each of its loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import singledispatch
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.points import drawn_points
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Band, Case, CaseResult, Settings
from tympan.studies.driven import grouped
from tympan.studies.films.family import FilmFamily
from tympan.studies.films.population import Population
from tympan.studies.force.result import ForceCurve, ForceResult
from tympan.studies.limits.curve import CurveResult
from tympan.studies.limits.voltages import first_limit
from tympan.studies.tolerance.drawn import BY_SPREAD, Scattered
from tympan.studies.tolerance.given import AMPLIFIER, LOAD, Tolerances
from tympan.studies.variables import VARIABLES

#: Films of a band, a power of two for Sobol's sequence: its edges are accurate to about 5 % of its
#: width.
_FILMS = 512
#: Largest share of missing films with which a band is computed.
_MISSED = 0.05
#: Quantiles of a band: low, median, high.
_TOLD = (0.05, 0.5, 0.95)
#: Number of voltages at which a curve has a band.
_VOLTAGES = 25
#: Largest force of a held plate over that of the film without scatter: at three standard deviations
#: of VHB's modulus, films are 1.8 times as stiff.
_FORCES = 1.8
#: Smallest force of a family over its largest: a film without force has no deflection, and errors
#: are relative to the deflection.
_LEAST = 0.05
#: Variables that have a band even where no film moves.
_ALWAYS = ("deflection_m", "stroke_m", "capacitance_F")
#: Seed of the random numbers.
_SEED = 1
#: Warning where there is no band.
FEW_REACH = ("more than 5 % of the films do not reach the voltage, or are beyond the range of "
             "their law: there is no band")


def bands(values: Array) -> tuple[Band | None, ...]:
    """Compute 5 %, median and 95 % of films at each load, (films, loads); None where many are nan.

    The first film is the one without scatter, which does not count.
    """
    found = []
    for films in values[1:].T:
        there = films[np.isfinite(films)]
        share = len(there) / len(films)
        low, median, high = (np.quantile(there, _TOLD).tolist() if share >= 1 - _MISSED
                             else (0.0, 0.0, 0.0))
        found.append(Band(low=low, median=median, high=high, share=share)
                     if share >= 1 - _MISSED else None)
    return tuple(found)


def quantity_bands(films: Population, mass: float, voltage: float) -> dict[str, Band]:
    """Compute bands of films under a nominal mass [kg] and voltage [V], by a result's keys."""
    return told_bands(films.numbers(mass, voltage))


def told_bands(numbers: Mapping[str, Array]) -> dict[str, Band]:
    """Compute bands of variables of films at one load by their keys, (films, 1) each.

    Variables in which all films are equal have none, but for :data:`_ALWAYS`.
    """
    found = {key: band for key, values in numbers.items()
             if VARIABLES[key].bounded for band in bands(values) if band is not None}
    return {key: band for key, band in found.items()
            if band.low < band.high or key in _ALWAYS}


@singledispatch
def banded(result: Any, specimen: Specimen, tolerances: Tolerances, rig: Rig, settings: Settings
           ) -> Any:
    """Add the bands of films made to the tolerances to a result."""
    raise NotImplementedError(type(result).__name__)


@banded.register
def _(result: CaseResult, specimen: Specimen, tolerances: Tolerances, rig: Rig, settings: Settings
      ) -> CaseResult:
    films = _under(specimen, tolerances, [result.mass_kg], result.voltage_V, rig, settings)
    found = quantity_bands(films, result.mass_kg, result.voltage_V)
    if found:
        return replace(result, bands=found)
    return replace(result, warnings=(*result.warnings, FEW_REACH))


@banded.register
def _(result: CurveResult, specimen: Specimen, tolerances: Tolerances, rig: Rig, settings: Settings
      ) -> CurveResult:
    table, masses = result.table, [curve.mass_kg for curve in result.curves]
    there = table["status"] == "equilibrium"
    if not there.any():
        return result
    highest = float(table["voltage"][there].max())
    made = dict[tuple[float, ...], Population]()
    curves = []
    for curve in result.curves:
        shares = tuple(curve.segment_shares.values())
        if shares not in made:
            wired = replace(specimen, electrode=specimen.electrode.with_shares(shares))
            made[shares] = _under(wired, tolerances, masses, highest, rig, settings)
        of_curve = there & result.rows_of(curve)
        voltages = np.linspace(0.0, table["voltage"][of_curve].max(initial=0.0), _VOLTAGES)
        deflections = made[shares].numbers(curve.mass_kg, voltages)["deflection_m"]
        curves.append(replace(curve, band_voltage_V=tuple(voltages.tolist()),
                              band_deflection_m=bands(deflections)))
    return replace(result, curves=tuple(curves))


@banded.register
def _(result: ForceResult, specimen: Specimen, tolerances: Tolerances, rig: Rig, settings: Settings
      ) -> ForceResult:
    forces = np.array([force for curve in result.curves for force in curve.force_N])
    most = _FORCES * float(forces.max(initial=0.0))
    if most <= 0:
        return result
    voltages = [curve.voltage_V for curve in result.curves]
    segments = [curve.segment_voltages_V for curve in result.curves]
    highest = max(map(abs, voltages))
    found: list[ForceCurve] = [*result.curves]
    first = result.curves[0]
    for wired, numbers in grouped(specimen, voltages, segments if any(segments) else ()):
        films = _held_films(wired, tolerances, most, highest, rig, settings)
        for number in numbers:
            across = films.across(voltages[number])[:, 0]
            columns = [_held(films, place, force, across) for place, force in
                       zip(found[number].displacement_m, first.force_N, strict=False)]
            band = bands(np.array(columns).reshape(len(columns), -1).T) if columns else ()
            found[number] = replace(found[number], band_force_N=band)
    return replace(result, curves=tuple(found))


def _held_films(specimen: Specimen, tolerances: Tolerances, most: float, voltage: float, rig: Rig,
                settings: Settings) -> Population:
    """Draw films whose plate is held by forces up to ``most`` [N], up to a nominal voltage [V]."""
    scattered = Scattered.of(specimen, tolerances)
    box = scattered.box()
    across = scattered.scaled(AMPLIFIER, 0.0, float(rig.film_voltage(voltage)))
    family = FilmFamily.over(box, scattered.scaled(LOAD, _LEAST * most, most), across, rig,
                             settings, BY_SPREAD)
    return scattered.films(family, box.row(specimen), points(scattered), rig)


def deflection_bands(specimen: Specimen, tolerances: Tolerances, masses: Sequence[float],
                     voltages: Sequence[float], rig: Rig, settings: Settings
                     ) -> list[tuple[Band | None, ...]]:
    """Compute bands of the deflection under each mass [kg] at each nominal voltage [V].

    None beyond the first limit of the film without scatter: half of the films are beyond their own.
    """
    limits = [first_limit(Case(specimen, mass=mass, rig=rig), settings) for mass in masses]
    reached = [np.inf if limit is None else limit.voltage_V for limit in limits]
    highest = min(max(map(abs, voltages)), max(reached))
    films = _under(specimen, tolerances, masses, highest, rig, settings)
    found = []
    for mass, most in zip(masses, reached, strict=True):
        there = [voltage for voltage in voltages if abs(voltage) <= most]
        of_mass = iter(bands(films.numbers(mass, there)["deflection_m"])
                       if there else ())
        found.append(tuple(next(of_mass) if voltage in there else None for voltage in voltages))
    return found


def _held(films: Population, place: float, force: float, across: Array) -> Array:
    """Compute forces [N] that hold plates at a place [m]; ``force`` [N] at 0 V is a near guess."""
    near = films.rests(np.full(len(across), max(force, 0.0)))
    near[:, 0] = np.where(np.isfinite(near[:, 0]), place, np.nan)
    return films.held(near, across)


def _under(specimen: Specimen, tolerances: Tolerances, masses: Sequence[float], voltage: float,
           rig: Rig, settings: Settings) -> Population:
    """Draw films for some masses [kg], up to a nominal voltage [V]."""
    forces = [float(rig.force(mass, specimen.plate_area)) for mass in masses]
    if not (any(forces) or rig.gas_pressure):
        raise InputError("must be above 0: without a load the plate of no film moves, so there is "
                         "no band", key="mass", given="0 g")
    scattered = Scattered.of(specimen, tolerances)
    loads = min(masses), max(masses)
    return scattered.population(loads, max(voltage, 1.0), points(scattered), rig, settings)


def points(scattered: Scattered) -> Array:
    """Draw the points of a band's films; the film without scatter is the first."""
    return scattered.with_nominal(drawn_points(scattered.inputs, _FILMS, _SEED))
