"""Loads that suit a film where none are given: by its gap, and by its own limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
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

#: How far a usual mass pulls the plate down, as a share of the gap between plate and frame: well
#: seen, and far from the film's end.
_SINKS = 0.1
#: Share of the first limit's voltage that is applied, with room for films that scatter.
_APPLIED = 0.6

_BORNE: Rule = (lambda x: 0 < x <= MOST_MASS, f"must be above 0, at most {MOST_MASS:g} kg")


@dataclass(frozen=True)
class LoadGrid:
    """Masses and voltages, every combination."""

    masses: Annotated[tuple[float, ...], Key("nominal loads", "mass", _BORNE, "mass")]
    voltages: Annotated[tuple[float, ...], Key("nominal voltages", "voltage", VOLTAGE_RULE,
                                               "voltage")] = ()

    @property
    def count(self) -> int:
        """Number of its combinations."""
        return len(self.masses) * len(self.voltages)


def usual_masses(specimen: Specimen, settings: Settings, rig: Rig = Rig(),
                 over: Sequence[float] = (1.0, 1.25)) -> tuple[float, ...]:
    """Masses [kg] that suit a film, ``over`` the one that pulls its plate down a tenth of the gap.

    Raises
    ------
    InputError
        When the plate cannot be pulled so far.
    """
    specimen.needed_plate()
    if rig.guide == "fixed":
        raise InputError("must let the plate move: no mass pulls it down", key="rig.guide",
                         given=rig.guide)
    model, rest = equilibrate(Case(specimen, mass=0.0, rig=rig), settings)
    start = rest.solution if rest.status == "equilibrium" else None
    deflection = _SINKS * specimen.gap + (start.state.plate.deflection if start else 0.0)
    pulled = held(model, deflection, start=start, settings=settings.path)
    mass = (pulled.state.force - rig.force(0.0, model.plate_area)) / rig.gravity
    if pulled.status != "equilibrium" or mass <= 0:
        raise InputError("no mass can be chosen for this film: give one", key="mass",
                         given=specimen.name)
    return tuple(min(_rounded(share * mass), MOST_MASS) for share in over)


def usual_voltages(specimen: Specimen, mass: float, settings: Settings, rig: Rig = Rig(),
                   over: Sequence[float] = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)) -> tuple[float, ...]:
    """Voltages [V] that suit a film under a mass [kg], ``over`` 0.6 of that of its first limit.

    Of a film without limit, as where a mechanism's table ends first, over 0.6 of the voltage up to
    which it is followed.

    Raises
    ------
    InputError
        When nothing limits the voltage.
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
    """Refuse loads under which a flat film stays flat: no voltage moves it, and none differs."""
    if specimen.plate is None:
        Case(specimen, mass=mass, rig=rig)  # refuses what would act on a plate
        if not rig.gas_pressure:
            raise InputError("must not be 0: without gas a film without plate stays flat",
                             key="rig.gas_pressure", given="0 Pa")
    elif not (mass > 0 or rig.gas_pressure):
        raise InputError("must be above 0: without a load the plate of no film moves", key="mass",
                         given=f"{1e3 * mass:g} g")


def charged(case: Case, voltage: float | str, settings: Settings) -> Case:
    """The case at a voltage: a number [V], a text with its unit, or "80 %" of its first limit.

    A share takes the film's way from 0 V to this limit; anything else takes no work.

    Raises
    ------
    InputError
        For a share that is no number from 0 to 100 %, and where the film has no first limit.
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
    """The value to two digits."""
    return float(f"{value:.2g}")
