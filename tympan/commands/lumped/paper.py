"""``tympan lumped paper``: the paper's figures 7 to 14 and Table 2 computed again."""

from __future__ import annotations

import argparse
from typing import Any

from tympan.options import argument, command, json_argument, output, parse_quantity, print_json


@command("lumped paper",
         output("paper.html, paper.json, figures (PNG, SVG), tables and curves (CSV)",
                required=True),
         argument("--levels", type=int, default=20, metavar="N",
                  help="of figure 14, which the paper does not give"),
         argument("--seed", type=int,
                  help="of these levels (default: the first one whose levels come within 100 V of "
                       "0 and of 7 kV)"),
         argument("--reading", choices=("rest", "levels"),
                  help="how Table 2 is read to find the lost parameters: from 0 to 7 kV at rest, "
                       "or at the ends of figure 14's levels (default: whichever fits it better)"),
         argument("--period",
                  help="of figure 13's sines, which the paper does not give (default: that at "
                       "which the circle lags most)"),
         json_argument("print one JSON object, which paper.json holds too"))
def run(options: argparse.Namespace) -> None:
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
    if options.json:
        print_json(content)
        return
    _show(content)
    print(page)


def _show(content: dict[str, Any]) -> None:
    print("Table 2, ranges in mm:       paper  ends of levels   at rest  all samples")
    for row in content["table_2"]["rows"]:
        print(f"  {row['specimen']:<17}{row['mass_g']:>6g} g {row['paper_mm']:>7.2f} "
              f"{row['at_levels_mm']:>15.3f} {row['at_rest_mm']:>9.3f} "
              f"{row['all_samples_mm']:>12.3f}")
    for key in ("table_2", "settling"):
        for words in content[key]["why"]:
            print(words)
    for words in content["chosen"]:
        print(f"chosen: {words}")
