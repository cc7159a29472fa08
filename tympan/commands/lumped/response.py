"""``tympan lumped simulate`` and ``linearise``: what lumped models do under a signal."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from tympan.commands.signal import SIGNAL, duration, signal_of
from tympan.geometry.errors import InputError
from tympan.options import (
    JSON,
    MESH,
    RIG,
    argument,
    command,
    finish,
    naming_options,
    output,
    parse_numbers,
    parse_quantity,
    print_record,
    read_rig,
    read_settings,
    read_specimens,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tympan.fem.rig import Rig
    from tympan.geometry.specimen import Specimen
    from tympan.studies.lumped.actuator import Actuator


#: Which actuators, for :func:`_actuators`.
_ACTUATORS = (
    argument("specimens", type=Path, nargs="*", metavar="SPECIMEN.toml",
             help="its membrane circles are found from its field model, and kept"),
    argument("--model", type=Path, nargs="+", default=[], metavar="NAME.lumped.toml",
             help="models that `tympan lumped build` made, instead of specimens or beside them"),
    argument("--mass", help="on the plate (default: one that suits the film)"),
    argument("--paper", action="store_true",
             help="the source paper's straight cones instead of membrane circles, 2 to 3 times as "
                  "soft; its 17.9 g where no mass is given"),
    argument("--alpha", metavar="A,B",
             help="with --paper: weights of the circles with the short and the long semi-axis, as "
                  "`tympan alpha` finds them (default: equal)"),
    argument("--table-1", type=float, metavar="EPS_R", dest="permittivity",
             help="with --paper: the paper's law with its constants instead of the films' "
                  "material; ε_r, lost in the paper, must be given"), RIG)


def _actuators(options: argparse.Namespace, voltage: float, rig: Rig
               ) -> tuple[list[Actuator], list[str]]:
    """The actuators asked for, good up to a voltage [V], and how they were chosen, in words."""
    from tympan.studies.lumped.model_file import read_model

    models = [read_model(file) for file in options.model]
    specimens = read_specimens(options.specimens, *(model.specimen.name for model in models))
    if not (specimens or models):
        raise InputError("give a specimen, or a model with --model", key="SPECIMEN.toml")
    for model in models:
        model.check(rig.film_voltage(voltage))
    remarks: list[str] = []
    mass = _mass(options, [*specimens, *(model.specimen for model in models)], rig, remarks)
    circles = (_cones(options, specimens, mass, rig, remarks) if options.paper
               else _membranes(options, specimens, mass, voltage, rig))
    return [*circles, *(model.actuator(mass, rig) for model in models)], remarks


def _mass(options: argparse.Namespace, specimens: Sequence[Specimen], rig: Rig,
          remarks: list[str]) -> float:
    from tympan.studies.limits.loads import usual_masses
    from tympan.studies.lumped.remarks import remark
    from tympan.studies.paper.published import MASSES

    if options.mass is not None:
        return parse_quantity(options.mass, "mass", "--mass")
    if options.paper:
        remarks.append(remark("mass", mass=1e3 * MASSES[0]))
        return MASSES[0]
    return min(usual_masses(specimen, read_settings(options), rig)[0] for specimen in specimens)


def _cones(options: argparse.Namespace, specimens: Sequence[Specimen], mass: float, rig: Rig,
           remarks: list[str]) -> list[Actuator]:
    """Actuators of cones, as the paper has them."""
    from tympan.studies.lumped.actuator import Actuator
    from tympan.studies.lumped.remarks import remark
    from tympan.studies.paper.table1 import eq8

    weights, permittivity = parse_numbers(options.alpha, "--alpha"), options.permittivity
    if permittivity is not None:
        if not 1 <= permittivity <= 1000:
            raise InputError("must be at least 1 (vacuum) and at most 1000", key="--table-1",
                             given=permittivity)
        specimens = [eq8(specimen, permittivity) for specimen in specimens]
    with naming_options(options, weights="alpha"):
        actuators = [Actuator.of(specimen, mass, weights, rig=rig) for specimen in specimens]
    if weights is None and any(actuator.count > 1 for actuator in actuators):
        remarks.append(remark("equal_weights"))
    return actuators


def _membranes(options: argparse.Namespace, specimens: Sequence[Specimen], mass: float,
               voltage: float, rig: Rig) -> list[Actuator]:
    from tympan.progress import bar
    from tympan.studies.lumped.suited import suited_model

    for key, given in (("--alpha", options.alpha), ("--table-1", options.permittivity)):
        if given is not None:
            raise InputError("is for the paper's cones, --paper: membrane circles have weights and "
                             "a film of their own", key=key, given=given)
    settings, models = read_settings(options), []
    with bar(4 * len(specimens)) as progress:
        for specimen in specimens:
            models.append(suited_model(specimen, mass, voltage, settings, rig, progress))
    return [model.actuator(mass, rig) for model in models]


@command("lumped simulate", *_ACTUATORS, *SIGNAL,
         argument("--swing", action="store_true",
                  help="the plate of a model whose film has branches has inertia; else it follows "
                       "the film at once"),
         output("write a dataset, transient.csv and dataset.toml, simulate.json and figures"), JSON,
         MESH, example='oval.toml --signal step --high "3.5 kV" -o step')
def lumped_simulate(options: argparse.Namespace) -> None:
    """Response to a step, ramp, sine, random steps or a CSV file. Deflections count downwards."""
    from tympan.progress import bar
    from tympan.studies.lumped.film_response import film_response
    from tympan.studies.lumped.model_file import read_model
    from tympan.studies.lumped.simulate import ModelResponse, sample, simulate
    from tympan.studies.trace import Responses, sample_count

    interval = duration(options.interval, "--interval")
    signal, period = signal_of(options)
    sample_count(signal.end, interval, len(options.specimens) + len(options.model))
    rig = read_rig(options.rig)
    actuators, remarks = _actuators(options, signal.peak, rig)
    films = {model.specimen.name: model for model in map(read_model, options.model) if model.film}
    responses: list[ModelResponse] = []
    stepped = options.signal == "step"
    with bar(len(actuators)) as progress:
        def over(share: float) -> None:
            progress(share=share)

        for actuator in actuators:
            progress(actuator.specimen.name)
            if model := films.get(actuator.specimen.name):
                responses.append(film_response(model, signal, actuator.mass, rig, interval, period,
                                               stepped, options.swing, over))
                continue
            responses.append(sample(simulate(actuator, signal, progress=over), interval, period,
                                    stepped, remarks))
    # Eq. (8) with Table 1's constants can be the film of no specimen file.
    specimens = tuple(actuator.specimen for actuator in actuators if options.permittivity is None)
    finish(options, Responses(tuple(responses), specimens, rig))


@command("lumped linearise", *_ACTUATORS,
         argument("--at", default="3 kV", metavar="VOLTAGE", help="about rest at this voltage"),
         argument("--input", choices=("U", "U2"), default="U",
                  help="what drives it: the voltage, or its square, with which the film's pull "
                       "goes, at 0 kV too"), JSON, MESH,
         example='oval.toml --at "3 kV" --mass "17.9 g"')
def lumped_linearise(options: argparse.Namespace) -> None:
    """Small motions about a rest: state space A, B, C, D, poles by name, gain."""
    from tympan.studies.lumped.linear import linearise
    from tympan.studies.lumped.remarks import origin, remark

    voltage = parse_quantity(options.at, "voltage", "--at")
    rig = read_rig(options.rig)
    actuators, remarks = _actuators(options, abs(voltage), rig)
    if voltage == 0 and options.input == "U":
        remarks.append(remark("no_voltage"))
    print_record(options, {"linear": [
        {"specimen": actuator.specimen.name, "mass_kg": actuator.mass,
         **linearise(actuator, voltage, by=options.input).json(),
         "warnings": [*remarks, *origin(actuator), *actuator.case(voltage).remarks]}
        for actuator in actuators]})
