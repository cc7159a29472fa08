"""``tympan diagnose``: what measured data say the simulation gets wrong, and which effect explains it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from tympan.options import command
from tympan.progress import shares


def add(commands: Any) -> None:
    """The command's options."""
    parser = command(commands, "diagnose", _run, "say what the simulation gets wrong about measured data, and why")
    parser.add_argument("dataset", type=Path, metavar="DATASET",
                        help="folder with dataset.toml and static.csv or range.csv")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder for the report and the extended model")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="processes (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of random draws (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _run(options: argparse.Namespace) -> None:
    from studies.dataset import read_dataset
    from studies.diagnosis.diagnose import diagnose
    from studies.diagnosis.record import as_json, write

    dataset = read_dataset(options.dataset)
    with shares("films") as progress:
        found = diagnose(dataset, options.workers, options.seed, progress)
    content = as_json(found)
    if options.output is not None:
        from reports.diagnosis import build

        write(found, content, options.output)
        report = build(options.output)
    if options.json:
        print(json.dumps(content, ensure_ascii=False, allow_nan=False))
        return
    from reports.diagnosis import HEADLINES, label, percent, sentence

    print(f"{HEADLINES[content['verdict']]} {sentence(content)}")
    for one in content["causes"]:
        print(f"  {percent(one['probability']):>10}  {label(one)}")
    for words in content["warnings"]:
        print(f"warning: {words}")
    if options.output is not None:
        print(report)
