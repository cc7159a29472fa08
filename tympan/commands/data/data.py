"""``tympan data``: check a dataset's folder and say what is in it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from tympan.options import command


def add(commands: Any) -> None:
    """The command's options."""
    parser = command(commands, "data", _run,
                     "check a dataset of measurements and say what is in it")
    parser.add_argument("dataset", type=Path, metavar="DATASET",
                        help="folder with dataset.toml and static.csv, range.csv, transient.csv or coupon.csv")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _run(options: argparse.Namespace) -> None:
    from tympan.studies.data.checks import summary
    from tympan.studies.data.dataset import read_dataset

    found = summary(read_dataset(options.dataset))
    if options.json:
        print(json.dumps(found, ensure_ascii=False, allow_nan=False))
    else:
        _print(found)


def _print(found: dict[str, Any]) -> None:
    print(f"{found['dataset']} (source: {found['source']})")
    for file in found["files"]:
        count = "" if file["readings"] is None else f"{file['readings']} readings, "
        print(f"  {file['name']:<14} {count}SHA-256 {file['sha256'][:12]}…")
    print(f"specimens  {', '.join(found['specimens'])}")
    if found["masses_kg"]:
        print(f"masses     {_listed([1e3 * mass for mass in found['masses_kg']], 'g')}")
    if found["voltages_V"]:
        print(f"voltages   {_listed([volts / 1e3 for volts in found['voltages_V']], 'kV')}")
    if found["runs"]:
        print(f"transients {found['runs']} runs")
    if found["channels"]:
        print(f"channels   {', '.join(found['channels'])}")
        print(f"repeats    {found['repeated_states']} states were read more than once")
        print(f"noise      {_noise(found['noise'])}")
    for words in found["warnings"]:
        print(f"warning: {words}")


def _listed(values: list[float], unit: str) -> str:
    """A few values, or how many there are and between which."""
    if len(values) <= 8:
        return f"{', '.join(f'{value:.6g}' for value in values)} {unit}"
    return f"{len(values)} from {values[0]:.6g} to {values[-1]:.6g} {unit}"


def _noise(noise: dict[str, Any]) -> str:
    """Standard deviation of one reading, given and found."""
    parts = []
    if noise["given_m"] is not None:
        parts.append(f"given: {1e6 * noise['given_m']:.4g} um")
    if noise["readings_with_their_own"]:
        parts.append(f"{noise['readings_with_their_own']} readings with their own")
    if noise["found_m"] is not None:
        value, low, high = (1e6 * noise["found_m"][key] for key in ("value", "low", "high"))
        parts.append(f"from repeats: {value:.4g} um (95 %: {low:.4g} to {high:.4g}, "
                     f"{noise['found_m']['degrees_of_freedom']} degrees of freedom)")
    return "; ".join(parts) or "not known"
