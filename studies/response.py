"""Response of a film and its plate to a small oscillation of the voltage, by frequency."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from math import pi
from typing import Annotated

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key
from tympan.base.progress import Progress
from tympan.fem.vibration.harmonic import Harmonic
from tympan.fem.vibration.modes import vibrations
from tympan.studies.case import (
    Case,
    CaseRecord,
    Deflection,
    Existence,
    Settings,
    UnknownCount,
    WallTime,
    Warnings,
    equilibrate,
    failure_reason,
)
from tympan.studies.modes import carried
from tympan.studies.rows import lists_of

#: Number of frequencies where none are given. The natural one is not among them: there the
#: amplitude of a plate that nothing damps has no bound.
USUAL_COUNT = 240

#: Lowest default frequency over the slowest branch's rate: there the branch follows at once.
_SLOW = 0.01
#: Highest default frequency over the plate's own: there inertia holds the plate.
_FAST = 10.0

#: Lowest default frequency for a film without branches, relative to the plate's own.
_LOWEST = 1e-3

#: Damping ratio below which nothing damps the plate, but for rounding.
_UNDAMPED = 1e-9
_UNBOUNDED = ("nothing damps the plate: towards its natural frequency the amplitude grows without "
              "bound; plate_damping of the rig or branches of the film bound it")

#: tr C_v at which a viscosity is tested for growth with stretch.
_STRETCHED = 6.0

#: Difference of voltages for a derivative [V].
_SLOPE = 1e-2


@dataclass(frozen=True, kw_only=True)
class ResponseResult(CaseRecord):
    """The numbers of ``response --json``: amplitudes and phases at each frequency."""

    ending = "-response"
    writer = "tympan response -o"
    indexed = ("frequency_Hz",)
    kinds = ("json",)
    drawn = ("png", "svg")

    status: Existence
    deflection_m: Deflection = None
    natural_Hz: Annotated[float | None, Key("natural frequency of the heave by itself; none where "
                                            "it does not swing")] = None
    damping: Annotated[float | None, Key("damping of the heave by itself, over the critical one; "
                                         "none where it does not swing")] = None
    frequency_Hz: Annotated[tuple[float, ...], Key("frequencies of the voltage's swing")] = ()
    amplitude_m_per_V: Annotated[tuple[float, ...], Key("amplitude of what the sensor reads, over "
                                                        "the source's nominal voltage")] = ()
    phase_deg: Annotated[tuple[float, ...], Key("phase of what the sensor reads")] = ()
    film_voltage_V_per_V: Annotated[tuple[float, ...], Key("amplitude of the film's own voltage "
                                                           "over the source's")] = ()
    dofs: UnknownCount
    wall_s: WallTime
    warnings: Warnings

    @property
    def rows(self) -> dict[str, Array]:
        """A row for each frequency."""
        return lists_of(self)


def response(case: Case, settings: Settings, frequencies: tuple[float, ...] = (),
             progress: Progress = lambda words: None) -> ResponseResult:
    """Solve the response of a film about its equilibrium to a small oscillation of the voltage.

    Without a plate it is that of the film's centre. The default frequencies [Hz] reach from the
    slowest branch to far above the plate's own. ``progress`` is called before each.

    Raises
    ------
    InputError
            Where the voltage is 0: forces go with its square, so a small oscillation about 0 moves
            nothing. Where a branch's viscosity varies over the film at rest.
    """
    began = time.perf_counter()
    if not case.film_voltage:
        raise InputError("must not be 0: forces go with the square of the voltage, so a small "
                         "swing about 0 moves nothing", key="--voltage",
                         given=f"{case.voltage:g} V")
    _check_flows(case)
    model, outcome = equilibrate(case, settings)
    result = ResponseResult(
        specimen=case.specimen.name, mass_kg=case.mass, voltage_V=case.voltage,
        status=outcome.status, dofs=model.unknowns, wall_s=0.0,
        warnings=(*case.rig.in_motion, *case.remarks))
    if outcome.status != "equilibrium":
        return replace(result, warnings=(failure_reason(outcome), *case.remarks))
    rig = case.rig
    plate = carried(case)
    harmonic = Harmonic(model, outcome.state, plate, rig.plate_damping,
                        rig.circuit)
    film = case.specimen.membrane.density or case.specimen.electrode.mass
    undamped = (float(vibrations(model, outcome.state, plate, 1).frequencies_Hz[0])
                if case.specimen.plate is not None or film else 0.0)
    s = _natural(harmonic, undamped)
    asked = np.array(frequencies or _frequencies(case, undamped))
    deflection, voltage = harmonic.response(asked, progress)
    supplied = (rig.source.film_voltage(case.voltage + _SLOPE)
                - rig.source.film_voltage(case.voltage - _SLOPE)) / (2 * _SLOPE)
    reading = deflection * supplied / (1 + 2j * pi * asked * rig.sensor_lag)
    unbounded = s is not None and -s.real < _UNDAMPED * abs(s)
    return replace(
        result, warnings=(*[_UNBOUNDED] * unbounded, *result.warnings),
        deflection_m=model.deflection(outcome.state),
        natural_Hz=None if s is None else abs(s.imag) / (2 * pi),
        damping=None if s is None else -s.real / abs(s),
        frequency_Hz=tuple(asked.tolist()), amplitude_m_per_V=_listed(np.abs(reading)),
        phase_deg=_listed(np.degrees(np.unwrap(np.angle(reading)))),
        film_voltage_V_per_V=_listed(np.abs(voltage)), wall_s=time.perf_counter() - began)


def _check_flows(case: Case) -> None:
    for branch in case.specimen.membrane.branches:
        if branch.flow.relative_viscosity(_STRETCHED, 0.0) != 1.0:
            raise InputError("must be 0: the frequency response takes the viscosity of a film at "
                             "rest as the same everywhere", key="membrane.branch.stretch_gain",
                             given=f"flow {branch.flow.flow}")


def _listed(values: Array) -> tuple[float, ...]:
    return tuple(values.tolist())


def _natural(harmonic: Harmonic, undamped: float) -> complex | None:
    """Find the natural s [1/s] of the deflection, None where it does not oscillate."""
    if not undamped:
        return None
    try:
        s = harmonic.natural(2j * pi * undamped)
    except RuntimeError:
        return None
    return s if abs(s.imag) > 1e-6 * abs(s) else None


def _frequencies(case: Case, undamped: float) -> tuple[float, ...]:
    slowest = max((branch.time for branch in case.specimen.membrane.branches), default=0.0)
    low = _SLOW / (2 * pi * slowest) if slowest else _LOWEST * undamped
    high = max(_FAST * undamped, 10 * low)
    return _listed(np.geomspace(low or 1e-3, high or 1e3, USUAL_COUNT))
