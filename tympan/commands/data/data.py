"""``tympan data``: check a dataset's folder and say what is in it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from tympan.options import JSON, argument, command, print_json


@command("data",
         argument("dataset", type=Path, metavar="DATASET",
                  help="folder with dataset.toml and static.csv, range.csv, transient.csv or "
                       "coupon.csv"), JSON)
def run(options: argparse.Namespace) -> None:
    """Check a dataset of measurements and say what is in it."""
    from tympan.studies.data.checks import summary
    from tympan.studies.data.dataset import read_dataset

    contents = summary(read_dataset(options.dataset))
    if options.json:
        print_json(contents)
    else:
        _show(contents)


def _show(contents: dict[str, Any]) -> None:
    print(f"{contents['dataset']} (source: {contents['source']})")
    for file in contents["files"]:
        count = "" if file["readings"] is None else f"{file['readings']} readings, "
        print(f"  {file['name']:<14} {count}SHA-256 {file['sha256'][:12]}…")
    print(f"specimens  {', '.join(contents['specimens'])}")
    if contents["masses_kg"]:
        print(f"masses     {_few_or_ends([1e3 * mass for mass in contents['masses_kg']], 'g')}")
    if contents["voltages_V"]:
        print(f"voltages   {_few_or_ends([volts / 1e3 for volts in contents['voltages_V']], 'kV')}")
    if contents["runs"]:
        print(f"transients {contents['runs']} runs")
    if contents["channels"]:
        print(f"channels   {', '.join(contents['channels'])}")
        print(f"repeats    {contents['repeated_states']} states were read more than once")
        print(f"noise      {_noise(contents['noise'])}")
    for warning in contents["warnings"]:
        print(f"warning: {warning}")


def _few_or_ends(values: list[float], unit: str) -> str:
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
