"""Runs in time as they are judged: without steady hum, and with corrected clocks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite
from typing import Annotated

from scipy.stats import norm

from tympan.base.fields import Key
from tympan.studies.columns import Sheet
from tympan.studies.data.late_clock import ClockShift, with_clocks
from tympan.studies.data.sampled_run import Faults, SampledRun, faults, runs_of
from tympan.studies.data.steady_lines import SteadyLine, steady_lines

#: Standard deviations of 95 % limits.
_LIMITS = float(norm.ppf(0.975))


@dataclass(frozen=True, kw_only=True)
class Hum:
    """A steady line of a run's spectrum, which is subtracted."""

    specimen: Annotated[str, Key("name of the specimen")]
    mass_kg: Annotated[float, Key("nominal load on the plate")]
    run: Annotated[str, Key("name of the run")]
    frequency_Hz: Annotated[float, Key("multiple of the mains'; as seen where it is none")]
    seen_Hz: Annotated[float, Key("where samples show it, folded at half their rate")]
    mains: Annotated[bool, Key("whether it is the mains'")]
    amplitude_um: Annotated[float, Key("amplitude")]
    low_um: Annotated[float, Key("lower 95 % limit")]
    high_um: Annotated[float | None, Key("upper 95 % limit; none where samples show but a part")]


@dataclass(frozen=True, kw_only=True)
class LateRun:
    """A run whose displacement lags or leads its voltage by more than a film can explain."""

    specimen: Annotated[str, Key("name of the specimen")]
    mass_kg: Annotated[float, Key("nominal load on the plate")]
    run: Annotated[str, Key("name of the run")]
    late_s: Annotated[float, Key("by how much later, below 0 earlier; its voltages are moved so")]
    low_s: Annotated[float, Key("lower limit")]
    high_s: Annotated[float, Key("upper limit")]


@dataclass(frozen=True, eq=False)
class CheckedRun:
    """A run: as it is judged, its faults, its hum, and its delay."""

    record: SampledRun
    faults: Faults
    lines: tuple[SteadyLine, ...] = ()
    shift: ClockShift | None = None

    @property
    def hum(self) -> tuple[Hum, ...]:
        """Its steady lines, the strongest first."""
        return tuple(Hum(
            specimen=self.record.specimen, mass_kg=self.record.mass, run=self.record.run,
            frequency_Hz=line.frequency, seen_Hz=line.seen, mains=line.mains,
            amplitude_um=1e6 * line.amplitude,
            low_um=1e6 * max(line.amplitude - _LIMITS * line.sigma, 0.0)
            if isfinite(line.sigma) else 1e6 * line.amplitude,
            high_um=1e6 * (line.amplitude + _LIMITS * line.sigma)
            if isfinite(line.sigma) else None) for line in self.lines)

    @property
    def late(self) -> tuple[LateRun, ...]:
        """Delay of the run's clock, if it has one."""
        if self.shift is None:
            return ()
        return (LateRun(specimen=self.record.specimen, mass_kg=self.record.mass,
                        run=self.record.run, late_s=self.shift.value, low_s=self.shift.low,
                        high_s=self.shift.high),)


def checked_runs(transients: Sheet) -> tuple[CheckedRun, ...]:
    """Check the runs of a file; include those that cannot be used, as they are."""
    runs = [CheckedRun(record, faults(record)) for record in runs_of(transients)]
    usable = [number for number, run in enumerate(runs) if not run.faults.fatal]
    quiet = list[SampledRun]()
    for number in usable:
        record = runs[number].record
        lines, hum = steady_lines(record)
        runs[number] = replace(runs[number], lines=lines)
        quiet.append(replace(record, displacement=record.displacement - hum))
    for number, (record, shift) in zip(usable, with_clocks(quiet), strict=True):
        runs[number] = replace(runs[number], record=record, shift=shift)
    return tuple(runs)
