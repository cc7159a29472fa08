"""What one command says of a case's coupons: a dataset is written, and judged as a user's is."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.external.case import table
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.diagnose import diagnose

#: Writes a dataset into a folder.
Writer = Callable[[Path], None]


def judged(write: Writer) -> dict[str, Any]:
    """What ``tympan diagnose --json`` prints of a dataset."""
    with tempfile.TemporaryDirectory() as scratch:
        write(Path(scratch))
        return diagnose(read_dataset(scratch)).json()


def command_table(datasets: Mapping[str, Writer]) -> tuple[str, dict[str, dict[str, Any]]]:
    """A table of what is said of each dataset, and the JSON objects."""
    content = {name: judged(write) for name, write in datasets.items()}
    rows = [[name, said["verdict"], f"{said['misfit']['baseline_rmse_kPa']:.2f}",
             f"{said['misfit']['noise_kPa']:.2f}", _alone(said), _gain(said)]
            for name, said in content.items()]
    return table(["readings", "verdict", "missed [kPa]", "noise [kPa]",
                  "effects alone, share of the misfit", "held out, before → after [kPa]"],
                 rows), content


def _alone(said: Mapping[str, Any]) -> str:
    """The effects that take away most, alone, with their sizes."""
    most = [attempt for attempt in said["attempts"] if attempt["explains"] >= 0.02][:3]
    return "; ".join(f"`{attempt['effect']}` {attempt['explains']:.0%} ({_sizes(attempt)})"
                     for attempt in most) or "none"


def _sizes(attempt: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {size['value']:.2f}{' ' + size['unit'] if size['unit'] else ''}"
                     for name, size in attempt["parameters"].items())


def _gain(said: Mapping[str, Any]) -> str:
    gain = said["gain"]
    if gain is None:
        return "none possible"
    return f"{gain['rmse_before_kPa']:.2f} → {gain['rmse_after_kPa']:.2f}"


def strip_dataset(name: str, film: str, reading: str = "") -> str:
    """A dataset.toml of a film tested by itself."""
    return (f'name = "{name}"\n{reading}\n[[specimen]]\nname = "strip"\n'
            'frame = { shape = "circle", radius = "1 cm" }\n[specimen.membrane]\n'
            f'prestretch = [1, 1]\n{film}\n')
