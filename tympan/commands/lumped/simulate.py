"""``tympan lumped simulate``: responses of the lumped model to any voltage in time."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tympan.geometry.errors import InputError
from tympan.options import (
    JSON,
    RIG,
    argument,
    check_distinct,
    command,
    finish,
    output,
    parse_numbers,
    parse_quantity,
    read_rig,
)

if TYPE_CHECKING:
    from tympan.geometry.specimen import Specimen
    from tympan.studies.lumped.signals import Signal


@command("lumped simulate", argument("specimens", type=Path, nargs="*", metavar="SPECIMEN.toml"),
         argument("--model", type=Path, nargs="+", default=[], metavar="NAME.lumped.toml",
                  help="models that `tympan lumped build` made, instead of specimens or beside "
                       "them"),
         argument("--signal", default="step", metavar="KIND",
                  help="step, ramp (up and down), sine, random, or a CSV file with t_s, "
                       "voltage_kV"),
         argument("--low", default="0 kV", help="before the step; lower end of the others"),
         argument("--high", default="3.5 kV", help="after the step; upper end"),
         argument("--duration", default="30 s",
                  help="of step and ramp; of each random level; period of a sine"),
         argument("--count", type=int, metavar="N",
                  help="random levels (default: 20); cycles of a sine (3)"),
         argument("--seed", type=int, default=0, help="of the random levels"),
         argument("--interval", default="1 ms", help="between samples written"),
         argument("--mass", default="17.9 g", help="on the plate"),
         argument("--alpha", metavar="A,B",
                  help="weights of the circles with the short and the long semi-axis, as `tympan "
                       "alpha` finds them (default: equal)"),
         argument("--table-1", type=float, metavar="EPS_R", dest="permittivity",
                  help="the paper's Eq. (8) with Table 1's constants instead of the films' "
                       "material; its ε_r, lost in the paper, must be given"), RIG,
         output("write transient.csv, simulate.json and figures"), JSON)
def run(options: argparse.Namespace) -> None:
    """Response to a step, ramp, sine, random steps or a CSV file."""
    from tympan.progress import bar
    from tympan.studies.lumped.actuator import Actuator
    from tympan.studies.lumped.model_file import read_model
    from tympan.studies.lumped.response import SampledResponse, SimulationResult, sample
    from tympan.studies.lumped.simulate import simulate

    mass = parse_quantity(options.mass, "mass", "--mass")
    interval = _positive(options.interval, "--interval")
    signal, period = _signal(options)
    rig, weights = read_rig(options.rig), parse_numbers(options.alpha, "--alpha")
    responses: list[SampledResponse] = []
    models = [read_model(file) for file in options.model]
    for model in models:
        model.check(rig.film_voltage(signal.peak))
    actuators = [*(Actuator.of(specimen, mass, weights, rig=rig)
                   for specimen in _specimens(options)),
                 *(model.actuator(mass, rig) for model in models)]
    if not actuators:
        raise InputError("give a specimen, or a model with --model", key="SPECIMEN.toml")
    check_distinct([actuator.specimen.name for actuator in actuators])
    with bar(len(actuators)) as progress:
        for number, actuator in enumerate(actuators):
            progress(actuator.specimen.name)
            equal = weights is None and number < len(actuators) - len(models)
            responses.append(sample(simulate(actuator, signal), interval, period,
                                    options.signal == "step", equal))
    finish(options, SimulationResult(tuple(responses)), _show)


def _show(result: dict[str, Any]) -> None:
    for response in result["responses"]:
        first, last, reach = (1e3 * response[key] for key in ("first_m", "last_m", "range_m"))
        settled = response["settling_time_s"]
        end = "" if settled is None else f", oscillation gone after {settled:.2f} s"
        print(f"{response['specimen']}, {1e3 * response['mass_kg']:g} g: {first:.4f} to {last:.4f} "
              f"mm, range {reach:.4f} mm{end}")
        for warning in response["warnings"]:
            print(f"warning: {warning}")


def _specimens(options: argparse.Namespace) -> list[Specimen]:
    from tympan.fem.film.library import load_specimen
    from tympan.studies.paper.table1 import eq8

    specimens = [load_specimen(file) for file in options.specimens]
    if options.permittivity is None:
        return specimens
    if not 1 <= options.permittivity <= 1000:
        raise InputError("must be at least 1 (vacuum) and at most 1000", key="--table-1",
                         given=options.permittivity)
    return [eq8(specimen, options.permittivity) for specimen in specimens]


def _signal(options: argparse.Namespace) -> tuple[Signal, float | None]:
    """The signal, and the period if it has one [s]."""
    from tympan.studies.lumped import signals

    low = parse_quantity(options.low, "voltage", "--low")
    high = parse_quantity(options.high, "voltage", "--high")
    duration = _positive(options.duration, "--duration")
    if options.count is not None and not 1 <= options.count <= 10_000:
        raise InputError("must be from 1 to 10000", key="--count", given=options.count)
    if options.signal == "step":
        return signals.step(low, high, 0.0, duration), None
    if options.signal == "ramp":
        return signals.ramp(low, high, duration), None
    if options.signal == "random":
        return signals.random_steps(low, high, duration, options.count or 20, options.seed), None
    if options.signal == "sine":
        return signals.Sine((low + high) / 2, (high - low) / 2, duration,
                            options.count or 3), duration
    if not options.signal.endswith(".csv"):
        raise InputError("must be step, ramp, sine, random or the name of a .csv file",
                         key="--signal", given=options.signal)
    return signals.read_signal(options.signal), None


def _positive(text: str, option: str) -> float:
    value = parse_quantity(text, "time", option)
    if not 0 < value < 1e9:
        raise InputError("must be positive", key=option, given=text)
    return value
