"""``tympan lumped paper``: the source paper's figures and tables."""

from __future__ import annotations

import argparse

from tympan.options import (
    SEEDS,
    argument,
    command,
    output,
    parse_quantity,
    print_record,
    save_and_draw,
)


@command("lumped paper",
         output("paper.html, paper.json, figures (PNG, SVG), tables and curves (CSV)",
                required=True),
         argument("--levels", type=int, default=20, metavar="N", within=(2, 1000),
                  help="of the random voltage steps, which the paper does not give"),
         argument("--seed", type=int, within=SEEDS,
                  help="of these levels (default: the first one whose levels come within 100 V of "
                       "0 and of 7 kV)"),
         argument("--reading", choices=("rest", "levels"),
                  help="how the paper's ranges are read to find its lost parameters: from 0 to "
                       "7 kV in equilibrium, or at the ends of the random steps (default: "
                       "whichever fits better)"),
         argument("--period",
                  help="of the sine voltages, which the paper does not give (default: that at "
                       "which the circle lags most)"),
         argument("--json", action="store_true",
                  help="print one JSON object, which paper.json holds too"),
         example="-o paper")
def lumped_paper(options: argparse.Namespace) -> None:
    """Compute figures and tables of the source paper again, and compare its numbers with ours."""
    import time

    from tympan.paper.figures import STEPS_OF_RUN, Choices, run
    from tympan.paper.output import PaperResult
    from tympan.progress import bar

    period = None if options.period is None else parse_quantity(options.period, "time", "--period")
    choices = Choices(options.levels, options.seed, period, reading=options.reading)
    began = time.perf_counter()
    with bar(STEPS_OF_RUN + 2) as progress:
        replica = run(choices, progress)
        progress("findings")
        result = PaperResult.of(replica, time.perf_counter() - began)
        progress("figures")
        drawn = save_and_draw(options, result)
    print_record(options, result.json(), drawn)
