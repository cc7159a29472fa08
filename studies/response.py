"""Response of a film and its plate to a small oscillation of the voltage, by frequency."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi
from typing import Annotated, Any

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

#: Amplitude over the largest of deflection and slopes times the frame's extent, below which there
#: is no motion but for rounding.
_NO_MOTION = 1e-9

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
    tilt_x_rad_per_V: Annotated[tuple[float, ...], Key(
        "amplitude of the plate's slope along x, over the source's nominal voltage; none where "
        "film and voltages are mirrored so that it does not tilt")] = ()
    tilt_x_phase_deg: Annotated[tuple[float, ...], Key("phase of that slope")] = ()
    tilt_y_rad_per_V: Annotated[tuple[float, ...], Key("the same along y")] = ()
    tilt_y_phase_deg: Annotated[tuple[float, ...], Key("phase of the slope along y")] = ()
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
             progress: Progress = lambda words: None, sine: Mapping[str, float] | None = None
             ) -> ResponseResult:
    """Solve the response of a film about its equilibrium to a small oscillation of the voltage.

    Without a plate it is that of the film's centre. The default frequencies [Hz] reach from the
    slowest branch to far above the plate's own. ``progress`` is called before each. ``sine``: how
    much of the oscillation each segment has, by its name, from -1 to 1; by default all swing in the
    proportion of their voltages.

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
    swing = None if sine is None else _swing(case, sine)
    mirrored = settings.symmetry and swing is None
    model, outcome = equilibrate(case, replace(settings, symmetry=mirrored))
    result = ResponseResult(
        specimen=case.specimen.name, mass_kg=case.mass, voltage_V=case.voltage,
        status=outcome.status, dofs=model.unknowns, wall_s=0.0,
        warnings=(*case.rig.in_motion, *case.remarks))
    if outcome.status != "equilibrium":
        return replace(result, warnings=(failure_reason(outcome), *case.remarks))
    rig = case.rig
    plate = carried(case)
    harmonic = Harmonic(model, outcome.state, plate, rig.plate_damping, rig.circuit, swing)
    film = case.specimen.membrane.density or case.specimen.electrode.mass
    undamped = (float(vibrations(model, outcome.state, plate, 1).frequencies_Hz[0])
                if case.specimen.plate is not None or film else 0.0)
    s = _natural(harmonic, undamped)
    asked = np.array(frequencies or _frequencies(case, undamped))
    motion = harmonic.response(asked, progress)
    supplied = (rig.source.film_voltage(case.voltage + _SLOPE)
                - rig.source.film_voltage(case.voltage - _SLOPE)) / (2 * _SLOPE)
    lagging = supplied / (1 + 2j * pi * asked * rig.sensor_lag)
    moved = np.column_stack([motion.deflection, model.size * motion.slopes]) * lagging[:, None]
    sizes = np.abs(moved).max(axis=0, initial=0.0)
    moved[:, sizes < _NO_MOTION * sizes.max()] = 0.0
    reading, slopes = moved[:, 0], moved[:, 1:] / model.size
    tilts: dict[str, Any] = {}
    for axis, slope in zip("xy", slopes.T, strict=True):
        if slope.any():
            tilts |= {f"tilt_{axis}_rad_per_V": _listed(np.abs(slope)),
                      f"tilt_{axis}_phase_deg": _listed(np.degrees(np.unwrap(np.angle(slope))))}
    unbounded = s is not None and -s.real < _UNDAMPED * abs(s)
    return replace(
        result, warnings=(*[_UNBOUNDED] * unbounded, *result.warnings),
        deflection_m=model.deflection(outcome.state),
        natural_Hz=None if s is None else abs(s.imag) / (2 * pi),
        damping=None if s is None else -s.real / abs(s),
        frequency_Hz=tuple(asked.tolist()), amplitude_m_per_V=_listed(np.abs(reading)),
        phase_deg=_listed(np.degrees(np.unwrap(np.angle(reading)))),
        **tilts, film_voltage_V_per_V=_listed(np.abs(motion.voltage)),
        wall_s=time.perf_counter() - began)


def _swing(case: Case, sine: Mapping[str, float]) -> tuple[float, ...]:
    """List the oscillation of each segment over the source's.

    Raises
    ------
    InputError
        When a name is that of no segment, or no segment with a voltage oscillates.
    """
    segments = case.specimen.electrode.segments
    names = [segment.name for segment in segments]
    unknown = [name for name in sine if name not in names]
    if unknown or not segments:
        raise InputError(f"must be names of segments: {', '.join(names)}" if names else
                         "must be left out: the electrode has no segments", key="sine",
                         given=", ".join(sine))
    if not all(-1 <= share <= 1 for share in sine.values()):
        raise InputError("must be from -1 to 1: how much of the oscillation a segment has",
                         key="sine", given=", ".join(map(str, sine.values())))
    if not any(sine.get(segment.name, 0.0) * segment.share for segment in segments):
        raise InputError("must name a segment that has a voltage: forces go with the square of the "
                         "voltage, so a small swing about 0 moves nothing", key="sine",
                         given=", ".join(sine))
    return tuple(float(sine.get(segment.name, 0.0)) for segment in segments)


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
