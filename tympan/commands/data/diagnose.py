"""``tympan diagnose``: what data say the simulation gets wrong, and which effect explains it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from tympan.options import JSON, WORKERS, argument, command, output, print_json
from tympan.progress import shares

if TYPE_CHECKING:
    from tympan.studies.data.dataset import Dataset


@command("diagnose",
         argument("dataset", type=Path, metavar="DATASET",
                  help="folder with dataset.toml and static.csv or range.csv"),
         output("folder for the report and the extended model"), WORKERS,
         argument("--seed", type=int, default=0, help="of random draws"),
         argument("--plan", action="store_true",
                  help="say what such readings can tell; what is read may be missing from the "
                       "files"), JSON)
def run(options: argparse.Namespace) -> None:
    """Say what the simulation gets wrong about measured data, and why."""
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.diagnosis.diagnose import diagnose

    dataset = read_dataset(options.dataset, options.plan)
    if options.plan:
        _plan(dataset, options)
        return
    with shares("films") as progress:
        diagnosis = diagnose(dataset, options.workers, options.seed, progress)
    content = diagnosis.json()
    if options.output is not None:
        from tympan.reports.diagnosis.page import build_diagnosis_page

        diagnosis.save(options.output)
        page = build_diagnosis_page(options.output)
    if options.json:
        print_json(content)
        return
    from tympan.reports.diagnosis import page as words

    print(f"{words.headline(content['verdict'])} {words.verdict_words(content)}")
    for cause in content["causes"]:
        print(f"  {words.probability_text(cause['probability']):>10}  {words.cause_label(cause)}")
    for warning in content["warnings"]:
        print(f"warning: {warning}")
    if options.output is not None:
        print(page)


def _plan(dataset: Dataset, options: argparse.Namespace) -> None:
    from tympan.studies.diagnosis.plan import plan_readings
    from tympan.studies.files import write_json

    with shares("films") as progress:
        record = plan_readings(dataset, options.workers, progress)
    if options.output is not None:
        write_json(options.output / "plan.json", record)
    if options.json:
        print_json(record)
        return
    print(f"{record['readings']} readings of {record['dataset']}, noise {record['noise_um']:.3g} "
          "um")
    print(f"{'effect':<40}{'parameter':<16}{'usual':>8}{'seen from':>11}{'told from':>11}  nearest "
          "rival")
    for effect in record["effects"]:
        unit = f" [{effect['unit']}]" if effect["unit"] else ""
        print(f"{effect['effect']:<40}{effect['parameter'] + unit:<16}"
              f"{effect['prior_width']:>8.3g}{_reached(effect['seen_from']):>11}"
              f"{_reached(effect['told_from']):>11}  {effect['rival'] or 'none'}")
    if record["not_visible"]:
        print("not visible, taken up by stiffness and permittivity: "
              f"{', '.join(record['not_visible'])}")
    for group in record["indistinguishable"]:
        print(f"not to be told apart: {', '.join(group)}")


def _reached(size: float | None) -> str:
    return "never" if size is None else f"{size:.3g}"
