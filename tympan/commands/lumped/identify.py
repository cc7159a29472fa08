"""``tympan lumped identify``: the lumped model's constants behind a dataset."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tympan.geometry.errors import InputError
from tympan.options import JSON, argument, command, finish, output, parse_numbers

if TYPE_CHECKING:
    from collections.abc import Callable

    from tympan.studies.data.dataset import Dataset
    from tympan.studies.identify.dynamic import DynamicFit
    from tympan.studies.identify.static import StaticFit

    Progress = Callable[[str], None]


@command("lumped identify",
         argument("dataset", type=Path, metavar="DATASET",
                  help="folder with dataset.toml and static.csv, transient.csv or both"),
         argument("--dynamic", action="store_true",
                  help="also k1, eta1 and eta2 from the responses of transient.csv, Eq. (12); the "
                       "static constants are those of static.csv or, where there is none, the "
                       "films' own"),
         argument("--law", choices=("eq8", "film"), default="eq8",
                  help="the paper's Eq. (8), or one factor on the films' own material"),
         argument("--alpha", choices=("each", "shared"), default="each",
                  help="an α of the circle with the short semi-axis for each shape, or one for all "
                       "as in Eq. (11)"),
         argument("--weights", metavar="A,B",
                  help="both α of all shapes, for --dynamic without static.csv (default: equal)"),
         argument("--objective", choices=("deflection", "force", "printed"), default="deflection",
                  help="misfit in deflection, in force as Eq. (11) with the signs of Eq. (5), or "
                       "as printed"),
         argument("--nelder-mead", action="store_true",
                  help="also the paper's simplex, to compare"),
         output("write identify.json and figures"), JSON)
def run(options: argparse.Namespace) -> None:
    """The constants behind a dataset's readings."""
    from tympan.progress import bar
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.identify.result import IdentifyResult

    dataset = read_dataset(options.dataset)
    result: dict[str, Any] = {"dataset": dataset.name}
    with bar((1 + options.dynamic) * (1 + options.nelder_mead)) as progress:
        static = _fit_static(dataset, options, result, progress)
        dynamic = _fit_dynamic(dataset, static, options, result,
                               progress) if options.dynamic else None
    finish(options, IdentifyResult.of(result, static, dynamic), _show)


def _show(record: dict[str, Any]) -> None:
    for kind in ("static", "dynamic"):
        if kind in record:
            _show_fit(f"{record['dataset']}, {kind}", record[kind],
                      record.get(f"nelder_mead_{kind}"))


def _fit_static(dataset: Dataset, options: argparse.Namespace, result: dict[str, Any],
                progress: Progress) -> StaticFit | None:
    from tympan.studies.identify.static import StaticProblem, identify_static, nelder_mead

    if options.dynamic and dataset.static is None:
        return None
    if options.weights is not None:
        raise InputError("is for --dynamic without static.csv, whose readings tell α",
                         key="--weights", given=options.weights)
    problem = StaticProblem.of(dataset, options.law, options.alpha)
    progress("readings at rest")
    fit = identify_static(problem, options.objective)
    result["static"] = fit.json()
    if options.nelder_mead:
        progress("readings at rest, simplex")
        result["nelder_mead_static"] = nelder_mead(problem)
    return fit


def _fit_dynamic(dataset: Dataset, static: StaticFit | None, options: argparse.Namespace,
                 result: dict[str, Any], progress: Progress) -> DynamicFit:
    from tympan.studies.identify.dynamic import (
        DynamicProblem,
        Exact,
        identify_dynamic,
        nelder_mead_dynamic,
    )
    from tympan.studies.identify.responses import records_of

    weights = parse_numbers(options.weights, "--weights")
    statics = static or Exact(dataset.specimens, dataset.rig, weights)
    problem = DynamicProblem(statics, dataset.rig, records_of(dataset), dataset.noise)
    progress("responses")
    fit = identify_dynamic(problem)
    result["dynamic"] = fit.json()
    if options.nelder_mead:
        progress("responses, simplex")
        result["nelder_mead_dynamic"] = nelder_mead_dynamic(problem)
    return fit


def _show_fit(title: str, fit: dict[str, Any], simplex: dict[str, Any] | None) -> None:
    print(f"{title}: misfit {fit['rmse_um']:.3g} um (noise {fit['noise_um']:.3g} um); "
          f"{fit['determined']} of {len(fit['constants'])} numbers are determined")
    for constant in fit["constants"]:
        limits = ("not determined by these data" if constant["low"] is None
                  else f"{constant['low']:.6g} to {constant['high']:.6g}")
        unit = "" if constant["unit"] == "1" else constant["unit"]
        print(f"  {constant['name']:<28}{constant['value']:>14.6g} {unit:<5}{limits}")
    for warning in fit["warnings"]:
        print(f"warning: {warning}")
    if simplex is not None:
        print(f"Nelder-Mead: misfit {simplex['rmse_um']:.3g} um, {simplex['evaluations']} "
              f"evaluations, {simplex['seconds']:.2f} s; least squares: {fit['evaluations']}, "
              f"{fit['seconds']:.2f} s")
