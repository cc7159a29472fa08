"""Digitised VHB tests as coupon files: ``python -m benchmarks.vhb.convert FOLDER``.

The folder holds ``vhb/hossain2012_cyclic.csv``, ``vhb/hossain2012_quasistatic.csv``,
``vhb4905/3_creep.csv`` and ``vhb4905/4_loading.csv`` as their sources have them; see README.md.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from tympan.studies.columns import write_sheet
from tympan.studies.data.coupon import COLUMNS, Coupons
from tympan.studies.files import MANIFEST

HERE = Path(__file__).parent
#: Tests of 4905 at 20 °C by their number: up and down, and held.
_CYCLES, _HELD = (116, 117, 118, 126, 127), (101, 102, 103, 104)
#: Runs of more readings than this keep every third.
_LONG = 60


def main(folder: Path) -> None:
    """Write both files."""
    for name, runs in (("vhb-4910", of_4910(folder / "vhb")),
                       ("vhb-4905", of_4905(folder / "vhb4905"))):
        file = HERE / f"{name}.csv"
        file.unlink(missing_ok=True)
        write_sheet(file, COLUMNS, _coupons(name, runs).columns)
    (HERE / MANIFEST).unlink()


def of_4910(folder: Path) -> Iterator[tuple[str, pd.DataFrame]]:
    """Each cycle with its times, and the two series at rest."""
    cycles = pd.read_csv(folder / "hossain2012_cyclic.csv")
    for _, run in cycles.groupby("id", sort=True):
        yield _cycle(run, float(run.rate.iloc[0]))
    for number, run in pd.read_csv(folder / "hossain2012_quasistatic.csv").groupby("id"):
        yield f"at rest {number}", run.assign(time=np.nan)


def of_4905(folder: Path) -> Iterator[tuple[str, pd.DataFrame]]:
    """Cycles and relaxation at 20 °C, the first reading of each relaxation left out."""
    cycles, relaxing = (pd.read_csv(folder / name, sep=";", decimal=",", encoding="latin-1")
                    for name in ("4_loading.csv", "3_creep.csv"))
    for number in _CYCLES:
        run = cycles[cycles.id == number]
        yield _cycle(run, float(run.vel.iloc[0]))
    for number in _HELD:
        run = relaxing[relaxing.id == number]
        yield f"held at {run.stretch.iloc[0]:g}", run.iloc[1:]


def _cycle(run: pd.DataFrame, rate: float) -> tuple[str, pd.DataFrame]:
    path = np.abs(np.diff(run.stretch, prepend=run.stretch.iloc[0])).cumsum()
    return f"{rate:g}/s to {run.stretch.max():.1f}", run.assign(time=path / rate)


def _coupons(specimen: str, runs: Iterator[tuple[str, pd.DataFrame]]) -> Coupons:
    parts = [(name, _thinned(run)) for name, run in runs]
    stretch, stress, time = (np.concatenate([run[column] for _, run in parts]).astype(float)
                             for column in ("stretch", "stress", "time"))
    names = np.repeat([name for name, _ in parts], [len(run) for _, run in parts])
    count = len(names)
    return Coupons(np.full(count, "uniaxial"), stretch.round(5), stress.round(1),
                   np.full(count, specimen), names, time.round(4))


def _thinned(run: pd.DataFrame) -> pd.DataFrame:
    if len(run) <= _LONG:
        return run
    kept = {*range(0, len(run), 3), int(np.argmax(run.stretch)), len(run) - 1}
    return run.iloc[sorted(kept)]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
