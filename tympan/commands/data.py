"""Commands about measured data: ``data``, ``diagnose``, and the ``effects`` it looks for."""

from __future__ import annotations

import argparse
from pathlib import Path

from tympan.options import JSON, WORKERS, argument, command, either, finish, output, print_record
from tympan.progress import shares


@command("data",
         argument("dataset", type=Path, metavar="DATASET",
                  help="folder with dataset.toml and static.csv, range.csv, transient.csv or "
                       "coupon.csv"), JSON)
def data(options: argparse.Namespace) -> None:
    """Check a dataset of measurements and say what is in it."""
    from tympan.studies.data.checks import summary
    from tympan.studies.data.dataset import read_dataset

    print_record(options, summary(read_dataset(options.dataset)))


@command("diagnose",
         argument("dataset", type=Path, metavar="DATASET",
                  help="folder with dataset.toml and static.csv or range.csv"),
         output("folder for the report and the extended model"), WORKERS,
         argument("--seed", type=int, default=0, help="of random draws"),
         argument("--plan", action="store_true",
                  help="say what such readings can tell; what is read may be missing from the "
                       "files"), JSON)
def diagnose(options: argparse.Namespace) -> None:
    """Say what the simulation gets wrong about measured data, and why."""
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.diagnosis.diagnose import diagnose, plan_readings
    from tympan.studies.files import write_json

    dataset = read_dataset(options.dataset, options.plan)
    if options.plan:
        with shares("films") as progress:
            record = plan_readings(dataset, options.workers, progress)
        if options.output is not None:
            write_json(options.output / "plan.json", record)
        print_record(options, record)
        return
    with shares("films") as progress:
        diagnosis = diagnose(dataset, options.workers, options.seed, progress)
    from tympan.reports.diagnosis import page

    finish(options, diagnosis, words=page)


@command("effects",
         either(JSON, argument("--markdown", action="store_true",
                               help="print the page docs/effects.md")))
def effects(options: argparse.Namespace) -> None:
    """List the effects a model may leave out, with units and priors."""
    from tympan.studies.effects import listing

    print_record(options, listing.listing(), listing=listing)
