"""Digitised VHB tests as coupon files: ``python -m benchmarks.vhb.convert FOLDER``.

The folder holds ``vhb/hossain2012_cyclic.csv``, ``vhb/hossain2012_quasistatic.csv``,
``vhb4905/3_creep.csv`` and ``vhb4905/4_loading.csv`` as their sources have them; see README.md.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tympan.base.process.folder import MANIFEST
from tympan.studies.columns import write_sheet
from tympan.studies.data.coupon import COLUMNS, Coupons, read_coupons

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


def of_4910(folder: Path) -> Iterator[tuple[str, Coupons]]:
    """Each cycle with its times, and the two series at rest."""
    for _, run in _runs(folder / "hossain2012_cyclic.csv"):
        yield _cycle(run)
    for number, run in _runs(folder / "hossain2012_quasistatic.csv"):
        yield f"at rest {number}", run


def of_4905(folder: Path) -> Iterator[tuple[str, Coupons]]:
    """Cycles and relaxation at 20 °C, the first reading of each relaxation left out."""
    cycles, relaxing = (dict(_runs(folder / name)) for name in ("4_loading.csv", "3_creep.csv"))
    for number in _CYCLES:
        yield _cycle(cycles[number])
    for number in _HELD:
        run = relaxing[number]
        yield f"held at {run.stretch[0]:g}", run[1:]


def _runs(file: Path) -> list[tuple[int, Coupons]]:
    """The runs of a file by their number, in that order."""
    tests = read_coupons(file)
    return sorted(((int(name.split()[-1]), tests[rows]) for name, rows in tests.series.items()),
                  key=lambda run: run[0])


def _cycle(run: Coupons) -> tuple[str, Coupons]:
    rate = np.abs(np.diff(run.stretch)).sum() / run.time[-1]
    return f"{rate:.6g}/s to {run.stretch.max():.1f}", run


def _coupons(specimen: str, runs: Iterator[tuple[str, Coupons]]) -> Coupons:
    parts = [(name, _thinned(run)) for name, run in runs]
    stretch, stress, time = (np.concatenate([getattr(run, column) for _, run in parts])
                             for column in ("stretch", "stress", "time"))
    names = np.repeat([name for name, _ in parts], [len(run) for _, run in parts])
    count = len(names)
    return Coupons(np.full(count, "uniaxial"), stretch.round(5), stress.round(1),
                   np.full(count, specimen), names, time.round(4))


def _thinned(run: Coupons) -> Coupons:
    if len(run) <= _LONG:
        return run
    kept = {*range(0, len(run), 3), int(np.argmax(run.stretch)), len(run) - 1}
    return run[sorted(kept)]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
