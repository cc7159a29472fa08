"""``tympan sensitivity``: how results answer to every number of specimen, rig and load."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from tympan.options import JSON, argument, case_arguments, command, read_case, read_settings, show

if TYPE_CHECKING:
    from tympan.studies.sensitivity import Answers


@command("sensitivity", *case_arguments(),
         argument("--of", default="heave", metavar="NAMES",
                  help="results, with commas between: heave, tilt, reaction, capacitance, energy, "
                       "max_stretch, max_true_stress, max_field (default: %(default)s); past "
                       "pull-in, the pull-in load"), JSON)
def run(options: argparse.Namespace) -> None:
    """Exact derivatives of results by every number that enters them."""
    from tympan.studies.sensitivity import sensitivity

    names = tuple(name.strip() for name in options.of.split(","))
    result = sensitivity(read_case(options), read_settings(options), names)
    if options.json:
        show(result.json(), True)
        return
    show({key: value for key, value in result.json().items() if key != "quantities"}, False)
    for quantity, answers in result.quantities.items():
        _show_quantity(quantity, answers)


def _show_quantity(quantity: str, answers: Answers) -> None:
    """What changes it most, first; what is zero has no per cent of itself, and comes last."""
    ordered = sorted(answers.by.items(), key=lambda item: -abs(item[1].elasticity or 0.0))
    width = max(map(len, answers.by))
    print(f"\n{quantity}  {answers.value:.6g} {answers.unit}\n"
          f"{'if this grows by 1 %':<{width}}  {'from':<18}  {'it changes by':<14}  derivative")
    for parameter, answer in ordered:
        share = "" if answer.elasticity is None else f"{answer.elasticity:+.4f} %"
        start = f"{answer.value:.6g} {_unit_text(answer.unit)}"
        print(f"{parameter:<{width}}  {start:<18}  {share:<14}  {answer.derivative:+.6g} "
              f"{_unit_text(answers.unit)} per {answer.unit}")


def _unit_text(unit: str) -> str:
    return "" if unit == "1" else unit
