"""Loads that suit a film if the user gives none, from its gap and its limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from tympan.base.errors import InputError
from tympan.base.fields import Key, number
from tympan.base.toml_reader import Rule
from tympan.fem.equilibrium.solve import held
from tympan.fem.rig import MOST_MASS, VOLTAGE_RULE, Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Settings, equilibrate
from tympan.studies.limits.voltages import first_limit, rise

#: Deflection under a suitable mass as a share of the gap between plate and frame: well visible, and
#: far from the film's limits.
_SINKS = 0.1
#: Share of the first limit's voltage that is applied; the rest is a margin for the scatter of
#: films.
_APPLIED = 0.6

_BORNE: Rule = (lambda x: 0 < x <= MOST_MASS, f"must be above 0, at most {MOST_MASS:g} kg")


@dataclass(frozen=True)
class LoadGrid:
    """Masses and voltages; every combination is one load.

    ``segment_voltages``: voltages of the segments of an electrode by name, a set for each voltage.
    """

    masses: Annotated[tuple[float, ...], Key("nominal loads", "mass", _BORNE, "mass")]
    voltages: Annotated[tuple[float, ...], Key("nominal voltages", "voltage", VOLTAGE_RULE,
                                               "voltage")] = ()
    #: Not stored: only loads of α are, which have none.
    segment_voltages: tuple[Mapping[str, float], ...] = field(default=(), compare=False)

    @property
    def count(self) -> int:
        """Number of combinations."""
        return len(self.masses) * len(self.voltages)


def usual_masses(specimen: Specimen, settings: Settings, rig: Rig = Rig(),
                 over: Sequence[float] = (1.0, 1.25)) -> tuple[float, ...]:
    """Find masses [kg] that suit a film.

    They are ``over`` times the mass that pulls its plate down by a tenth of the gap.

    Raises
    ------
    InputError
        If the plate cannot be pulled so far.
    """
    specimen.needed_plate()
    if rig.guide == "fixed":
        raise InputError("must let the plate move: no mass pulls it down", key="rig.guide",
                         given=rig.guide)
    model, rest = equilibrate(Case(specimen, mass=0.0, rig=rig), settings)
    start = rest.solution if rest.status == "equilibrium" else None
    deflection = _SINKS * specimen.gap + (start.state.plate.deflection if start else 0.0)
    pulled = held(model, deflection, start=start, settings=settings.path)
    mass = rig.nominal_mass(pulled.state.force, model.plate_area)
    if pulled.status != "equilibrium" or mass <= 0:
        raise InputError("no mass can be chosen for this film: give one", key="mass",
                         given=specimen.name)
    return tuple(min(_rounded(share * mass), MOST_MASS) for share in over)


def usual_voltages(specimen: Specimen, mass: float, settings: Settings, rig: Rig = Rig(),
                   over: Sequence[float] = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)) -> tuple[float, ...]:
    """Find voltages [V] that suit a film under a mass [kg].

    They are ``over`` times 0.6 of the voltage of its first limit. If the film has no limit, for
    example because a mechanism's table ends first, the voltage up to which it is followed replaces
    the limit.

    Raises
    ------
    InputError
        If nothing limits the voltage.
    """
    risen = rise(Case(specimen, mass=mass, rig=rig), settings, first=True)
    first = risen.limits.limit
    end = first.voltage_V if first else max((case.voltage for case in risen.cases), default=0.0)
    if not 0 < end < np.inf:
        raise InputError("no voltage can be chosen for this film, since it has no limit: give one",
                         key="voltage", given=specimen.name)
    highest = _rounded(_APPLIED * end)
    return tuple(round(share * highest, 6) for share in over)


def require_moved(specimen: Specimen, rig: Rig, mass: float) -> None:
    """Raise InputError for loads under which a flat film stays flat at every voltage."""
    if specimen.plate is None:
        Case(specimen, mass=mass, rig=rig)  # raises InputError for settings that act on a plate
        if not rig.gas_pressure:
            raise InputError("must not be 0: without gas a film without plate stays flat",
                             key="rig.gas_pressure", given="0 Pa")
    elif not (mass > 0 or rig.gas_pressure):
        raise InputError("must be above 0: without a load the plate of no film moves", key="mass",
                         given=f"{1e3 * mass:g} g")


def charged(case: Case, voltage: float | str, settings: Settings) -> Case:
    """Set the voltage of a case: a number [V], a text with unit, or "80 %" of its first limit.

    For a share the film is followed from 0 V to this limit; other values need no computation.

    Raises
    ------
    InputError
        If a share is no number from 0 to 100 %, or if the film has no first limit.
    """
    if not (isinstance(voltage, str) and voltage.strip().endswith("%")):
        return replace(case, voltage=number(voltage, "voltage", "voltage"))
    try:
        share = float(voltage.strip().removesuffix("%")) / 100
    except ValueError:
        share = np.nan
    if not 0 <= share <= 1:
        raise InputError('must be from 0 to 100 %, such as "80 %", or a voltage with its unit',
                         key="voltage", given=voltage)
    first = first_limit(case, settings)
    if first is None or not np.isfinite(first.voltage_V):
        raise InputError("there is no first limit to take a share of: give a voltage with its unit",
                         key="voltage", given=voltage)
    return replace(case, voltage=share * first.voltage_V)


def _rounded(value: float) -> float:
    """Round a value to two significant digits."""
    return float(f"{value:.2g}")
