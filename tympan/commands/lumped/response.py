"""``tympan lumped simulate`` and ``linearise``: response of lumped models to a signal."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from tympan.base.errors import InputError
from tympan.commands.signal import SIGNAL, wave_of
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
    read_mounted_all,
    read_settings,
)

if TYPE_CHECKING:
    from tympan.studies.lumped.case import ChosenActuators, LumpedCase

#: Arguments that choose actuators, for :func:`read_case`.
ACTUATORS = (
    argument("specimens", type=Path, nargs="*", metavar="SPECIMEN.toml|NAME.lumped.toml",
             help="a specimen, whose membrane circles are found from its field model and kept; or "
                  "a model that `tympan lumped build` made"),
    argument("--model", type=Path, nargs="+", default=[], metavar="NAME.lumped.toml",
             help="models, too"),
    argument("--mass", help="of plate, hook and weight (default: one that suits the film)"),
    argument("--paper", action="store_true",
             help="the source paper's straight cones instead of membrane circles, 2 to 3 times as "
                  "soft; its 17.9 g where no mass is given"),
    argument("--alpha", metavar="A,B",
             help="with --paper: weights of the circles with the short and the long semi-axis, as "
                  "`tympan alpha` finds them (default: equal)"),
    argument("--table-1", type=float, metavar="EPS_R",
             help="with --paper: the paper's law with its constants instead of the films' "
                  "material; ε_r, lost in the paper, must be given"), RIG)


def read_case(options: argparse.Namespace) -> LumpedCase:
    """Read the actuators and the load that are requested."""
    from tympan.geometry.specimen import Specimen
    from tympan.studies.lumped.case import LumpedCase
    from tympan.studies.lumped.model_file import read_actuator, read_model

    given = [read_actuator(file) for file in options.specimens]
    models = (*(item for item in given if not isinstance(item, Specimen)),
              *map(read_model, options.model))
    specimens, rig = read_mounted_all(options, [
        item for item in given if isinstance(item, Specimen)])
    if not (specimens or models):
        raise InputError("give a specimen or a model", key="SPECIMEN.toml")
    mass = None if options.mass is None else parse_quantity(options.mass, "mass", "--mass")
    with naming_options(options):
        return LumpedCase(specimens, models, mass=mass, paper=options.paper,
                          alpha=parse_numbers(options.alpha, "--alpha"), table_1=options.table_1,
                          rig=rig)


def chosen_actuators(options: argparse.Namespace, case: LumpedCase, voltage: float
                     ) -> ChosenActuators:
    """Read the requested actuators, valid up to a voltage [V]."""
    from tympan.progress import bar

    with naming_options(options), bar(4 * len(case.specimens)) as progress:
        return case.chosen(voltage, read_settings(options), progress)


@command("lumped simulate", *ACTUATORS, *SIGNAL,
         argument("--swing", action="store_true",
                  help="the plate of a model whose film has branches has inertia; else it follows "
                       "the film at once"),
         output("write a dataset, transient.csv and dataset.toml, simulate.json and figures"), JSON,
         MESH, example='oval.toml --signal step --high "3.5 kV" -o step')
def lumped_simulate(options: argparse.Namespace) -> None:
    """Simulate a step, ramp, sine, random steps or a CSV file. Deflections count downwards."""
    from tympan.progress import bar

    case = read_case(options)
    wave, signal = wave_of(options, len(options.specimens) + len(options.model))
    chosen = chosen_actuators(options, case, signal.peak)
    with bar(len(chosen.actuators)) as progress:
        result = chosen.responses(wave, signal, options.swing, progress)
    finish(options, result)


@command("lumped linearise", *ACTUATORS,
         argument("--voltage", default="3 kV", formerly="--at",
                  help="about rest at this voltage"),
         argument("--input", choices=("U", "U2"), default="U",
                  help="what drives it: the voltage, or its square, with which the film's pull "
                       "goes, at 0 kV too"),
         argument("--save", type=Path, metavar="FILE",
                  help="also store A, B, C, D: NAME.mat for MATLAB, NAME.npz for NumPy, NAME.csv "
                       "or NAME.json"), JSON, MESH,
         example='oval.toml --voltage "3 kV" --mass "17.9 g"')
def lumped_linearise(options: argparse.Namespace) -> None:
    """Linearise about an equilibrium: state space A, B, C, D, poles by name, gain."""
    from tympan.result import Result, file_writers
    from tympan.studies.lumped.linear import LinearResult

    if options.save is not None:
        file_writers(LinearResult, options.save, "--save")
    case = read_case(options)
    voltage = parse_quantity(options.voltage, "voltage", "--voltage")
    chosen = chosen_actuators(options, case, abs(voltage))
    result = Result(chosen.linear(voltage, options.input))
    drawn = [] if options.save is None else [result.save(options.save)]
    print_record(options, result.json(), drawn)
