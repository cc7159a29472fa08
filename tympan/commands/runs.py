"""Commands that compute the plan of a file, and draw it again: study, sweep, design, report."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from tympan.base.errors import Failure, InputError
from tympan.base.process.folder import alone
from tympan.commands.cases import TOLERANCES, given_tolerances
from tympan.options import (
    JSON,
    MESH,
    WORKERS,
    argument,
    command,
    either,
    finish,
    naming_file,
    naming_options,
    output,
    parse_quantity,
    print_record,
    read_settings,
    read_workers,
    save_and_draw,
)


@command("study",
         argument("file", nargs="?", type=Path, metavar="STUDY.toml",
                  help="which specimens and loads"),
         TOLERANCES, output(default=Path("out")),
         example="-o out")
def study(options: argparse.Namespace) -> None:
    """Solve specimens, draw their stress, derive α, write a report; default: the paper's three."""
    from tympan.progress import bar
    from tympan.studies.study import default_study, read_study, run_study

    planned = read_study(options.file) if options.file else default_study()
    planned = planned.within(given_tolerances(options))
    with bar(planned.steps + 1) as progress:
        result = run_study(planned, progress, options.output)
        progress("report")
        page, = save_and_draw(options, result)
    print(page)


@command("sweep",
         argument("file", type=Path, metavar="SWEEP.toml",
                  help="which specimens, masses and voltages"),
         output("tables as netCDF, Parquet and CSV; finished cases, which are not solved again",
                required=True),
         either(WORKERS,
                argument("--scheduler", metavar="ADDRESS",
                         help='of a Dask cluster, such as "tcp://10.0.0.5:8786"')),
         argument("--voltage", metavar="VOLTAGE", formerly="--at",
                  help="one of the sweep's, at which the page compares films, and --best does "
                       "(default: the highest)"),
         argument("--best", metavar="RESULT",
                  help='also list the cases with the largest of a result, such as "stroke"'),
         argument("--under", metavar="CONDITION", action="append", default=[],
                  help='that they keep at every voltage up to that, such as "max_true_stress < '
                       '131 kPa, breakdown_margin > 1.5"; a least stroke, force or work is one at '
                       "that voltage"),
         argument("--exact", action="store_true",
                  help="solve every row by finite elements; without, many specimens that differ in "
                       "numbers alone are solved by a reduced film, its error in each row"),
         TOLERANCES,
         argument("--wait", metavar="TIME", default="60 s",
                  help="for a worker of the cluster where there is none"), JSON, MESH,
         example="SWEEP.toml -o sweep")
def sweep(options: argparse.Namespace) -> None:
    """Solve grids, lists or samples of specimens; continue an interrupted sweep."""
    from tympan.fem.results.limit_states import LIMIT_STATES
    from tympan.progress import cases, say
    from tympan.reports.rebuild import draw_result
    from tympan.studies.parallel import processes
    from tympan.studies.sweep.cluster import cluster
    from tympan.studies.sweep.plan import read_sweep
    from tympan.studies.sweep.run import Checkpoint, run_sweep, unsolved

    workers = read_workers(options)
    wait = parse_quantity(options.wait, "time", "--wait")
    if wait < 0:
        raise InputError("must not be negative", key="--wait", given=options.wait)
    planned = read_sweep(options.file, read_settings(options), options.exact,
                         given_tolerances(options))
    if options.under and options.best is None:
        raise InputError("needs --best: conditions on the best cases", key="--under",
                         given=", ".join(options.under))
    with naming_options(options):
        if options.voltage is not None:
            planned = planned.compared_at(options.voltage)
        if options.best is not None:  # its errors are reported before anything is solved
            unsolved(planned).best(options.best, under=options.under)
    # Drawing takes longer to import than a plan to read, whose errors are reported first.
    from tympan.reports.sweep.page import keep_page

    pool = (partial(processes, workers=workers) if options.scheduler is None
            else partial(cluster, address=options.scheduler, wait=wait, say=say))
    try:
        with cases(planned.cases) as progress:
            result = run_sweep(planned, options.output, pool, progress, keep_page(options.output),
)
    except (KeyboardInterrupt, Failure) as ending:
        kept = Checkpoint(options.output).cases(planned)
        ending.add_note(f"{kept} of {planned.cases} cases are kept, the same command goes on from "
                        "there")
        raise
    page, = draw_result(result, options.output)
    asked = {}
    if options.best is not None:
        asked["best"] = result.best(options.best, under=options.under).json()
    print_record(options, {"table": str(options.output / "sweep.nc"), "page": str(page),
                           **result.json(), **asked}, states=LIMIT_STATES)


@command("design",
         argument("requirements", type=Path, nargs="?", metavar="REQUIREMENTS.toml",
                  help="what is wanted, what is given and what may vary, as docs/howto/design.md "
                       "has it; left out: the paper's large ellipse, at most as large a frame"),
         output("for specimens and rigs (TOML), the numbers (JSON, CSV) and a picture (PNG, SVG)"),
         WORKERS, JSON, MESH,
         example="REQUIREMENTS.toml -o design", also=("optimize", "best"),
         formerly=("optimise",))
def design(options: argparse.Namespace) -> None:
    """Find films for requirements: the best ones, the active bounds, and the cost of relaxing them.

    95 % of the films with their tolerances keep all bounds. Each film is checked by finite
    elements, and compared with the given one. Bounds that no film can keep are named, with what
    can be kept instead.
    """
    from tympan.progress import bar
    from tympan.studies.design.design import design as best_films
    from tympan.studies.design.requirements import Requirements

    requirements = (Requirements.shipped() if options.requirements is None
                    else Requirements.read(options.requirements))
    with naming_file(options.requirements), bar(len(requirements.specimens)) as progress:
        result = best_films(requirements, read_settings(options), progress, read_workers(options))
    finish(options, result)


@command("compare", argument("first", type=Path, metavar="FIRST"),
         argument("second", type=Path, metavar="SECOND"), JSON,
         example="solved again", also=("diff", "difference", "versus"))
def compare(options: argparse.Namespace) -> None:
    """List the values that differ between two stored results of one kind, and by how much.

    Each is the folder of a command's results, or the file of one of several results there.
    """
    from tympan.reports.comparison import differences
    from tympan.result import Result

    first, second = (Result.load(stored) for stored in (options.first, options.second))
    print_record(options, {"differences": [
        each.record() for each in differences(first.numbers, second.numbers)]})


@command("report", argument("folder", type=Path, metavar="DIR"),
         example="out")
def report(options: argparse.Namespace) -> None:
    """Rebuild a run's figures and report from what it stored."""
    from tympan.progress import waiting
    from tympan.reports.rebuild import rebuild

    folder = options.folder if options.folder.is_dir() else None
    with alone(folder), waiting("figures and report"):
        files = rebuild(options.folder)
    for file in files:
        print(file)
