"""Commands about the lumped model: made from field models, simulated, identified, the paper's."""

from __future__ import annotations

import argparse
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tympan.commands.signal import SIGNAL, duration, signal_of
from tympan.geometry.errors import InputError
from tympan.options import (
    JSON,
    MESH,
    RIG,
    SEEDS,
    argument,
    command,
    finish,
    naming_file,
    naming_options,
    output,
    parse_numbers,
    parse_quantities,
    parse_quantity,
    print_record,
    read_rig,
    read_settings,
    read_specimens,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from tympan.fem.rig import Rig
    from tympan.geometry.specimen import Specimen
    from tympan.studies.case import Settings
    from tympan.studies.data.dataset import Dataset
    from tympan.studies.lumped.actuator import Actuator, Viscous


@command("lumped build", argument("specimens", type=Path, nargs="+", metavar="SPECIMEN.toml"),
         argument("--mass", metavar="MASS,MASS",
                  help="on the plate; the first one is fitted, the others are tested (default: "
                       "some that suit the films)"),
         argument("--voltages", metavar="FROM..TO",
                  help="the lowest, the middle and the highest are fitted, the others tested "
                       "(default: up to 0.6 of the films' first limit)"),
         argument("--count", type=int, default=11, metavar="N", within=(2, 200),
                  help="of voltages"),
         argument("--circles", type=int, default=2, metavar="N", help="how many"),
         argument("--radii", choices=("semi_axes", "sectors", "fit"), default="semi_axes",
                  help="of the circles, as for `tympan alpha`"),
         argument("--viscous", metavar="K1,ETA1,ETA2",
                  help="of the branch and the damper of films that have no branches of their own, "
                       'such as "23.5 MPa,177.2 MPa s,62.4 kPa s" (default: these, the '
                       "paper's)"), RIG,
         output("write NAME.lumped.toml for each, build.json, statics.csv and a figure"), JSON,
         MESH,
         example="oval.toml -o lumped")
def lumped_build(options: argparse.Namespace) -> None:
    """The lumped model of specimens from their field model alone."""
    from tympan.progress import bar
    from tympan.studies.alpha import AlphaSettings
    from tympan.studies.lumped.build import KINEMATICS, BuildResult, BuildSettings, build

    with naming_options(options):
        AlphaSettings(circles=options.circles)
    masses = (parse_quantities(options.mass, "mass", "--mass") if options.mass is not None
              else None)
    voltages = _voltages(options) if options.voltages is not None else None
    settings, rig = read_settings(options), read_rig(options.rig)
    specimens = read_specimens(options.specimens)
    branched = [item.name for item in specimens if item.membrane.branches]
    if branched and options.viscous is not None:
        raise InputError("is for films without branches: theirs come from the field model",
                         key="--viscous", given=", ".join(branched))
    chosen = BuildSettings.suited(specimens, settings, rig, masses=masses, voltages=voltages,
                                  count=options.count, circles=options.circles, radii=options.radii,
                                  viscous=_viscous(options.viscous))
    with bar(4 * len(specimens) + len(branched)) as progress:
        models = [build(specimen, settings, chosen, rig, progress) for specimen in specimens]
    finish(options, BuildResult.of(models), kinematics=KINEMATICS)


def _voltages(options: argparse.Namespace) -> tuple[float, ...]:
    ends = options.voltages.split("..")
    if len(ends) != 2:
        raise InputError("must be two voltages with two dots between them, such as 0 kV..5 kV",
                         key="--voltages", given=options.voltages)
    low, high = (parse_quantity(end, "voltage", "--voltages") for end in ends)
    if not 0 <= low < high:
        raise InputError("must ascend, from 0 kV on", key="--voltages", given=options.voltages)
    return tuple(low + (high - low) * number / (options.count - 1)
                 for number in range(options.count))


def _viscous(text: str | None) -> Viscous:
    from tympan.studies.lumped.actuator import Viscous

    if text is None:
        return Viscous()
    parts = text.split(",")
    if len(parts) != 3:
        raise InputError("must be a stress and two viscosities with commas between them",
                         key="--viscous", given=text)
    try:
        return Viscous(*(parse_quantity(part, kind, "--viscous")
                         for part, kind in zip(parts, ("stress", "viscosity", "viscosity"),
                                               strict=True)))
    except InputError as error:
        raise InputError(error.allowed, key="--viscous", given=error.given) from None


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
             help="with --paper: its Eq. (8) with Table 1's constants instead of the films' "
                  "material; its ε_r, lost in the paper, must be given"), RIG)


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
    """As the paper has them."""
    from tympan.studies.lumped.actuator import Actuator
    from tympan.studies.lumped.remarks import remark
    from tympan.studies.paper.table1 import eq8

    weights, permittivity = parse_numbers(options.alpha, "--alpha"), options.permittivity
    if permittivity is not None:
        if not 1 <= permittivity <= 1000:
            raise InputError("must be at least 1 (vacuum) and at most 1000", key="--table-1",
                             given=permittivity)
        specimens = [eq8(specimen, permittivity) for specimen in specimens]
    with _weighed("--alpha", options.alpha):
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
    from tympan.studies.lumped.simulate import (
        SampledResponse,
        SimulationResult,
        sample,
        sample_count,
        simulate,
    )

    interval = duration(options.interval, "--interval")
    signal, period = signal_of(options)
    sample_count(signal.end, interval)
    rig = read_rig(options.rig)
    actuators, remarks = _actuators(options, signal.peak, rig)
    films = {model.specimen.name: model for model in map(read_model, options.model) if model.film}
    responses: list[SampledResponse] = []
    with bar(len(actuators)) as progress:
        for actuator in actuators:
            progress(actuator.specimen.name)
            if model := films.get(actuator.specimen.name):
                responses.append(film_response(model, signal, actuator.mass, rig, interval, period,
                                               options.signal == "step", options.swing))
                continue
            responses.append(sample(simulate(actuator, signal), interval, period,
                                    options.signal == "step", remarks))
    # Eq. (8) with Table 1's constants can be the film of no specimen file.
    specimens = tuple(actuator.specimen for actuator in actuators if options.permittivity is None)
    finish(options, SimulationResult(tuple(responses), specimens, rig))


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
         "warnings": [*remarks, *origin(actuator)]} for actuator in actuators]})


@command("lumped identify",
         argument("dataset", type=Path, metavar="DATASET",
                  help="folder with dataset.toml and static.csv, transient.csv or both"),
         argument("--model", type=Path, nargs="+", default=[], metavar="NAME.lumped.toml",
                  help="of its specimens, as `tympan lumped build` made them (default: membrane "
                       "circles found from the field model of each, and kept)"),
         argument("--paper", action="store_true",
                  help="the source paper's straight cones instead of membrane circles"),
         argument("--dynamic", action="store_true",
                  help="also k1, eta1 and eta2 from the responses of transient.csv, Eq. (12); the "
                       "static constants are those of static.csv or, where there is none, the "
                       "films' own"),
         argument("--law", choices=("eq8", "film"),
                  help="the paper's Eq. (8), or one factor on the films' own material (default: "
                       "film; eq8 with --paper)"),
         argument("--alpha", choices=("each", "shared", "given"),
                  help="an α of the first circle for each shape, one for all as in Eq. (11), or "
                       "those of the models (default: given; each with --paper)"),
         argument("--weights", metavar="A,B",
                  help="with --paper: both α of all shapes, for --dynamic without static.csv "
                       "(default: equal)"),
         argument("--objective", choices=("deflection", "force", "printed"), default="deflection",
                  help="misfit in deflection, in force as Eq. (11) with the signs of Eq. (5), or "
                       "as printed"),
         argument("--no-limits", action="store_true",
                  help="no profiles of the misfit: linearised limits only, at once"),
         argument("--nelder-mead", action="store_true",
                  help="also the paper's simplex, to compare"),
         output("write estimates.json as soon as there are any, identify.json and figures"), JSON,
         MESH, example="readings --dynamic -o identified")
def lumped_identify(options: argparse.Namespace) -> None:
    """The constants behind a dataset's readings."""
    from tympan.progress import bar
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.identify.dynamic import (
        DynamicProblem,
        Exact,
        identify_dynamic,
        nelder_mead_dynamic,
    )
    from tympan.studies.identify.responses import records_of
    from tympan.studies.identify.result import IdentifyResult
    from tympan.studies.identify.static import (
        Law,
        Sharing,
        StaticProblem,
        identify_static,
        nelder_mead,
        readings_at_rest,
    )

    dataset = read_dataset(options.dataset)
    at_rest = dataset.static is not None or not options.dynamic
    with naming_file(options.dataset):
        records = records_of(dataset) if options.dynamic else ()
        if at_rest:
            readings_at_rest(dataset)
    record: dict[str, Any] = {"dataset": dataset.name}
    static = dynamic = None
    with bar((1 + options.dynamic) * (1 + options.nelder_mead)
             + 4 * len(dataset.specimens)) as progress:
        actuators = _nominal(options, dataset, at_rest, progress)
        if at_rest:
            law: Law = options.law or ("eq8" if options.paper else "film")
            alpha: Sharing = options.alpha or ("each" if options.paper else "given")
            problem = StaticProblem.of(dataset, actuators, law, alpha)
            progress("readings at rest")
            static = identify_static(problem, options.objective, not options.no_limits,
                                     _teller(options, record, "static"))
            record["static"] = static.json()
            if options.nelder_mead:
                progress("readings at rest, simplex")
                record["nelder_mead_static"] = nelder_mead(problem)
        if options.dynamic:
            equal = options.paper and options.weights is None
            responses = DynamicProblem(static or Exact(actuators, equal), records, dataset.noise)
            progress("responses")
            dynamic = identify_dynamic(responses, not options.no_limits,
                                       _teller(options, record, "dynamic"))
            record["dynamic"] = dynamic.json()
            if options.nelder_mead:
                progress("responses, simplex")
                record["nelder_mead_dynamic"] = nelder_mead_dynamic(responses)
    finish(options, IdentifyResult.of(record, static, dynamic))


def _teller(options: argparse.Namespace, record: dict[str, Any], kind: str
            ) -> Callable[[dict[str, float]], None]:
    """Prints and stores estimates of a kind while their limits are still sought."""
    from tympan.studies.files import write_json

    def tell(values: dict[str, float]) -> None:
        words = ", ".join(f"{name} {value:.6g}" for name, value in values.items())
        print(f"{kind}: {words}; limits follow", file=sys.stderr)
        if options.output is not None:
            fits = {name: fit["constants"] for name, fit in record.items()
                    if name in ("static", "dynamic")}
            write_json(options.output / "estimates.json",
                       {"dataset": record["dataset"], **fits, kind: values})

    return tell


@contextmanager
def _weighed(option: str, given: str | None) -> Iterator[None]:
    """What is wrong with weights is said of the option that gave them."""
    try:
        yield
    except InputError as error:
        if error.key != "weights":
            raise
        raise InputError(error.allowed, key=option, given=given) from None


def _nominal(options: argparse.Namespace, dataset: Dataset, at_rest: bool,
             progress: Callable[[str], None]) -> tuple[Actuator, ...]:
    """The actuators of a dataset's specimens as they should be, in their order, under any mass."""
    from tympan.studies.lumped.actuator import paper_cones
    from tympan.studies.lumped.model_file import read_model

    weights = parse_numbers(options.weights, "--weights")
    if weights is not None and (at_rest or not options.paper):
        words = ("is for --dynamic without static.csv, whose readings tell α" if at_rest
                 else "is for the paper's cones, --paper")
        raise InputError(words, key="--weights", given=options.weights)
    if options.paper:
        if options.model:
            raise InputError("cannot be given with --paper", key="--model",
                             given=", ".join(map(str, options.model)))
        with _weighed("--weights", options.weights):
            return paper_cones(dataset.specimens, weights, dataset.rig)
    if not options.model:
        return _suited(dataset, read_settings(options), progress)
    models = {model.specimen.name: model for model in map(read_model, options.model)}
    missing = [specimen.name for specimen in dataset.specimens if specimen.name not in models]
    if missing:
        raise InputError(f"must hold a model of each specimen: none is of {', '.join(missing)}",
                         key="--model", given=", ".join(models))
    return tuple(models[specimen.name].actuator(1.0, dataset.rig)
                 for specimen in dataset.specimens)


def _suited(dataset: Dataset, settings: Settings, progress: Callable[[str], None]
            ) -> tuple[Actuator, ...]:
    """Membrane circles built for the largest loads of each specimen's readings."""
    from tympan.studies.lumped.suited import suited_model

    tables = [table for table in (dataset.static, dataset.transients) if table is not None]
    actuators = []
    for specimen in dataset.specimens:
        loads = [table[name][table.specimen == specimen.name].max(initial=0.0)
                 for name in ("mass", "voltage") for table in tables]
        masses, voltages = loads[:len(tables)], loads[len(tables):]
        actuators.append(suited_model(specimen, float(max(masses)), float(max(voltages)), settings,
                                      dataset.rig, progress).actuator(1.0, dataset.rig))
    return tuple(actuators)


@command("lumped paper",
         output("paper.html, paper.json, figures (PNG, SVG), tables and curves (CSV)",
                required=True),
         argument("--levels", type=int, default=20, metavar="N", within=(2, 1000),
                  help="of figure 14, which the paper does not give"),
         argument("--seed", type=int, within=SEEDS,
                  help="of these levels (default: the first one whose levels come within 100 V of "
                       "0 and of 7 kV)"),
         argument("--reading", choices=("rest", "levels"),
                  help="how Table 2 is read to find the lost parameters: from 0 to 7 kV at rest, "
                       "or at the ends of figure 14's levels (default: whichever fits it better)"),
         argument("--period",
                  help="of figure 13's sines, which the paper does not give (default: that at "
                       "which the circle lags most)"),
         argument("--json", action="store_true",
                  help="print one JSON object, which paper.json holds too"),
         example="-o paper")
def lumped_paper(options: argparse.Namespace) -> None:
    """The paper's figures 7 to 14 and tables, its numbers beside ours."""
    import time

    from tympan.progress import bar
    from tympan.reports.paper.page import build_paper_page
    from tympan.studies.replica.figures import STEPS_OF_RUN, Choices, run
    from tympan.studies.replica.output import store

    period = None if options.period is None else parse_quantity(options.period, "time", "--period")
    choices = Choices(options.levels, options.seed, period, reading=options.reading)
    began = time.perf_counter()
    with bar(STEPS_OF_RUN + 2) as progress:
        replica = run(choices, progress)
        progress("findings")
        content = store(replica, time.perf_counter() - began, options.output)
        progress("figures")
        page = build_paper_page(options.output)
    print_record(options, content, page=page)
