"""Options for a signal of voltages in time, which several commands take."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from tympan.base.errors import InputError
from tympan.options import SEEDS, Argument, argument, parse_quantity

if TYPE_CHECKING:
    from tympan.studies.signals import Signal, Wave

def voltages(high: Argument) -> tuple[Argument, ...]:
    """List all options of a signal but its interval; ``high`` is that of its upper end."""
    return (
        argument("--signal", default="step", metavar="KIND",
                 help="step, ramp (up and down), sine, random, or a CSV file with t_s, "
                      "voltage_kV"),
        argument("--low", default="0 kV", help="before the step; lower end of the others"),
        high,
        argument("--duration", default="30 s",
                 help="of step and ramp; of each random level; period of a sine"),
        argument("--count", type=int, metavar="N", within=(1, 10_000),
                 help="random levels (default: 20); cycles of a sine (3)"),
        argument("--seed", type=int, default=0, within=SEEDS, help="of the random levels"))


_HIGH = argument("--high", default="3.5 kV", help="after the step; upper end")
SIGNAL = (*voltages(_HIGH), argument("--interval", default="1 ms", help="between samples written"))


def wave_of(options: argparse.Namespace, count: int, high: float | None = None
            ) -> tuple[Wave, Signal]:
    """Read the wave of the options for a number of actuators, and build its signal.

    ``high``: its upper end [V] where the option has no default and is not given.
    """
    from tympan.studies.signals import Wave
    from tympan.studies.trace import sample_count

    interval = duration(options.interval, "--interval")
    wave = Wave(options.signal, low=parse_quantity(options.low, "voltage", "--low"),
                high=(high if options.high is None and high is not None
                      else parse_quantity(options.high, "voltage", "--high")),
                duration=duration(options.duration, "--duration"), interval=interval,
                count=options.count, seed=options.seed)
    signal = wave.signal("--signal")
    sample_count(signal.end, interval, count)
    return wave, signal


def duration(text: str, option: str) -> float:
    """Read a positive time [s]."""
    value = parse_quantity(text, "time", option)
    if not 0 < value < 1e9:
        raise InputError("must be positive, below 1e9 s", key=option, given=text)
    return value
