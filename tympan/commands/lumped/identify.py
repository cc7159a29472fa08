"""``tympan lumped identify``: constants of lumped models from readings."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    from tympan.studies.identify.identify import Teller


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
         MESH, example="readings --dynamic -o identified",
         also=("identify",))
def lumped_identify(options: argparse.Namespace) -> None:
    """Identify the constants of lumped models from a dataset's readings."""
    from tympan.progress import bar
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.identify.identify import IdentifySettings, identify
    from tympan.studies.lumped.model_file import read_model

    dataset = read_dataset(options.dataset)
    chosen = IdentifySettings(
        tuple(map(read_model, options.model)), options.paper, options.dynamic, options.law,
        options.alpha, parse_numbers(options.weights, "--weights"), options.objective,
        not options.no_limits, options.nelder_mead)
    with naming_file(options.dataset):
        chosen.require(dataset)
    with naming_options(options), bar(chosen.steps(dataset)) as progress:
        result = identify(dataset, chosen, read_settings(options), progress, _teller(options))
    finish(options, result)


def _teller(options: argparse.Namespace) -> Teller:
    """Make a function that prints and stores estimates while their limits are still computed."""
    from tympan.studies.files import write_json

    def tell(kind: str, values: dict[str, float], record: dict[str, Any]) -> None:
        words = ", ".join(f"{name} {value:.6g}" for name, value in values.items())
        print(f"{kind}: {words}; limits follow", file=sys.stderr)
        if options.output is not None:
            fits = {name: fit["constants"] for name, fit in record.items()
                    if name in ("static", "dynamic")}
            write_json(options.output / "estimates.json",
                       {"dataset": record["dataset"], **fits, kind: values})

    return tell
