"""``tympan lumped identify``: constants of lumped models from readings."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tympan.geometry.errors import InputError
from tympan.options import (
    JSON,
    MESH,
    argument,
    command,
    finish,
    naming_file,
    naming_options,
    output,
    parse_numbers,
    read_settings,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from tympan.studies.case import Settings
    from tympan.studies.data.dataset import Dataset
    from tympan.studies.lumped.actuator import Actuator


@command("lumped identify",
         argument("dataset", type=Path, metavar="DATASET",
                  help="folder with dataset.toml and static.csv, transient.csv or both"),
         argument("--model", type=Path, nargs="+", default=[], metavar="NAME.lumped.toml",
                  help="of its specimens, as `tympan lumped build` made them (default: membrane "
                       "circles found from the field model of each, and kept)"),
         argument("--paper", action="store_true",
                  help="the source paper's straight cones instead of membrane circles"),
         argument("--dynamic", action="store_true",
                  help="also k1, eta1 and eta2 from the responses of transient.csv; the "
                       "static constants are those of static.csv or, where there is none, the "
                       "films' own"),
         argument("--law", choices=("eq8", "film"),
                  help="the source paper's law, or one factor on the films' own material "
                       "(default: film; eq8 with --paper)"),
         argument("--alpha", choices=("each", "shared", "given"),
                  help="an α of the first circle for each shape, one for all, or those of the "
                       "models (default: given; each with --paper)"),
         argument("--weights", metavar="A,B",
                  help="with --paper: both α of all shapes, for --dynamic without static.csv "
                       "(default: equal)"),
         argument("--objective", choices=("deflection", "force", "printed"), default="deflection",
                  help="misfit in deflection or in force; printed: in force with the signs that "
                       "the source paper prints"),
         argument("--no-limits", action="store_true",
                  help="no profiles of the misfit: linearised limits only, at once"),
         argument("--nelder-mead", action="store_true",
                  help="also by the simplex of Nelder and Mead, to compare"),
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
        with naming_options(options):
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
