"""Commands about measured data: ``data``, ``diagnose``, and the ``effects`` it looks for."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tympan.base.errors import InputError
from tympan.options import (
    FORMULA,
    JSON,
    SEEDS,
    WORKERS,
    argument,
    command,
    either,
    finish,
    naming_file,
    naming_options,
    output,
    print_record,
    read_workers,
)
from tympan.progress import shares

if TYPE_CHECKING:
    from tympan.studies.diagnosis.self_check import Bench


@command("data",
         argument("dataset", type=Path, metavar="DATASET", nargs="?",
                  help="folder with dataset.toml and files of readings, such as static.csv or "
                       "force.csv; a folder without any is told which there are"),
         argument("--draft", type=Path, metavar="FILE",
                  help="write a first dataset.toml for a table of yours, beside it or to -o: every "
                       "line is a guess with its reason, for you to correct"),
         argument("--kind", metavar="KIND", help="what the table of --draft is: static, transient, "
                                                 "force, coupon, frequency or range (default: "
                                                 "guessed)"),
         argument("-o", "--output", type=Path, metavar="TOML", dest="target",  # no folder to lock
                  help="file for --draft"), JSON,
         example="readings")
def data(options: argparse.Namespace) -> None:
    """Check a dataset of measurements and say what is in it; or draft one for a table."""
    from tympan.studies.data.checks import summary
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.data.draft import write_draft

    if (options.draft is None) == (options.dataset is None):
        raise InputError("must be given, or --draft with a table of yours, one of both",
                         key="DATASET")
    if options.draft is not None:
        written = write_draft(options.draft, options.target, options.kind)
        print_record(options, {"written": str(written)}, text=lambda **_: str(written))
        return
    print_record(options, summary(read_dataset(options.dataset)))


@command("diagnose",
         argument("dataset", type=Path, metavar="DATASET",
                  help="folder with dataset.toml and static.csv or range.csv"),
         output("folder for the report and the extended model"), WORKERS,
         argument("--seed", type=int, default=0, within=SEEDS, help="of random draws"),
         argument("--plan", action="store_true",
                  help="say what such readings can tell; what is read may be missing from the "
                       "files"),
         argument("--self-check", type=int, default=0, metavar="N", within=(0, 100_000),
                  help="hide errors in N synthetic sets of such readings and count what is said"),
         FORMULA, JSON,
         example="readings -o diagnosis", also=("validate", "calibrate"))
def diagnose(options: argparse.Namespace) -> None:
    """Say what the simulation gets wrong about measured data, and why."""
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.diagnosis.diagnose import by_formula, conclude, plan_readings
    from tympan.studies.files import write_json

    with naming_options(options):
        dataset = by_formula(read_dataset(options.dataset, options.plan), options.formula)
    if options.plan:
        with naming_file(options.dataset), shares("films") as progress:
            record, bench = plan_readings(dataset, read_workers(options), progress)
        record["self_check"] = _self_check(options, bench)
        if options.output is not None:
            write_json(options.output / "plan.json", record)
        print_record(options, record)
        return
    with naming_file(options.dataset), shares("films") as progress:
        conclusions = conclude(dataset, read_workers(options), options.seed, progress)
    diagnosis = conclusions.diagnosis(options.output is not None,
                                      _self_check(options, conclusions.bench))
    from tympan.reports.diagnosis import page

    finish(options, diagnosis, words=page)


def _self_check(options: argparse.Namespace, bench: Bench) -> dict[str, Any] | None:
    """Judge synthetic readings and write their page; None where no self-check is requested."""
    from tympan.reports.rebuild import draw_result
    from tympan.studies.diagnosis.self_check import self_checked

    if not options.self_check:
        return None
    with shares("synthetic sets") as progress:
        check = self_checked(replace(bench, seed=options.seed), options.self_check,
                             read_workers(options), progress)
    if options.output is not None:
        check.save(options.output)
        draw_result(check, options.output)
    return check.json()


@command("effects",
         either(JSON, argument("--markdown", action="store_true",
                               help="print the page docs/effects.md")),
         example="--json")
def effects(options: argparse.Namespace) -> None:
    """List the effects a model may leave out, with units and priors."""
    from tympan.studies.effects import listing

    print_record(options, listing.listing(), listing=listing)
