"""``tympan diagnose``: what measured data say the simulation gets wrong, and which effect explains it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tympan.options import command
from tympan.progress import shares

if TYPE_CHECKING:
    from tympan.studies.data.dataset import Dataset


def add(commands: Any) -> None:
    """The command's options."""
    parser = command(commands, "diagnose", _run,
                     "say what the simulation gets wrong about measured data, and why")
    parser.add_argument("dataset", type=Path, metavar="DATASET",
                        help="folder with dataset.toml and static.csv or range.csv")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR",
                        help="folder for the report and the extended model")
    parser.add_argument("--workers", type=int, default=2, metavar="N",
                        help="processes (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0,
                        help="of random draws (default: %(default)s)")
    parser.add_argument("--plan", action="store_true",
                        help="say what such readings can tell; what is read may be missing from the files")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _run(options: argparse.Namespace) -> None:
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.diagnosis.diagnose import diagnose
    from tympan.studies.diagnosis.output import as_json, write

    dataset = read_dataset(options.dataset, options.plan)
    if options.plan:
        _plan(dataset, options)
        return
    with shares("films") as progress:
        found = diagnose(dataset, options.workers, options.seed, progress)
    content = as_json(found)
    if options.output is not None:
        from tympan.reports.diagnosis.page import build

        write(found, content, options.output)
        report = build(options.output)
    if options.json:
        print(json.dumps(content, ensure_ascii=False, allow_nan=False))
        return
    from tympan.reports.diagnosis.page import HEADLINES, label, percent, sentence

    print(f"{HEADLINES[content['verdict']]} {sentence(content)}")
    for one in content["causes"]:
        print(f"  {percent(one['probability']):>10}  {label(one)}")
    for words in content["warnings"]:
        print(f"warning: {words}")
    if options.output is not None:
        print(report)


def _plan(dataset: Dataset, options: argparse.Namespace) -> None:
    from tympan.studies.diagnosis.plan import plan
    from tympan.studies.files import write_json

    with shares("films") as progress:
        found = plan(dataset, options.workers, progress).record()
    if options.output is not None:
        write_json(options.output / "plan.json", found)
    if options.json:
        print(json.dumps(found, ensure_ascii=False, allow_nan=False))
        return
    print(f"{found['readings']} readings of {found['dataset']}, noise {found['noise_um']:.3g} um")
    print(f"{'effect':<40}{'parameter':<16}{'usual':>8}{'seen from':>11}{'told from':>11}  nearest rival")
    for one in found["effects"]:
        unit = f" [{one['unit']}]" if one["unit"] else ""
        sizes = f"{one['prior_width']:>8.3g}{_reached(one['seen_from']):>11}{_reached(one['told_from']):>11}"
        print(f"{one['effect']:<40}{one['parameter'] + unit:<16}{sizes}  {one['rival'] or 'none'}")
    if found["not_visible"]:
        print(f"not visible, taken up by stiffness and permittivity: {', '.join(found['not_visible'])}")
    for group in found["indistinguishable"]:
        print(f"not to be told apart: {', '.join(group)}")


def _reached(size: float | None) -> str:
    return "never" if size is None else f"{size:.3g}"
