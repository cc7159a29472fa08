"""Films, studies, tables of readings."""

from __future__ import annotations

from pathlib import Path

from benchmarks.trials.fuzz.contents import (
    COUPON,
    DATASET,
    RANGE,
    REQUIREMENTS,
    RIG,
    SIGNAL,
    SPECIMENS,
    STATIC,
    STUDY,
    SWEEP,
    TRANSIENT,
)
from benchmarks.trials.fuzz.kind import Kind, register
from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig
from tympan.studies.data.checks import summary
from tympan.studies.data.dataset import read_dataset
from tympan.studies.design.requirements import Requirements
from tympan.studies.signals import read_signal
from tympan.studies.study import read_study
from tympan.studies.sweep.plan import read_sweep


def _texts(*parts: str) -> tuple[bytes, ...]:
    return tuple(part.encode() for part in parts)


def _dataset(folder: Path) -> None:
    summary(read_dataset(folder))


register("specimen", Kind("specimen.toml", _texts(*SPECIMENS.values()),
                          lambda folder: load_specimen(folder / "specimen.toml")))
register("rig", Kind("rig.toml", _texts(RIG), lambda folder: Rig.read(folder / "rig.toml")))
register("study", Kind("STUDY.toml", _texts(STUDY),
                       lambda folder: read_study(folder / "STUDY.toml"), 30.0))
register("sweep", Kind("SWEEP.toml", _texts(SWEEP),
                       lambda folder: read_sweep(folder / "SWEEP.toml")))
register("design", Kind("REQUIREMENTS.toml", _texts(REQUIREMENTS),
                        lambda folder: Requirements.read(folder / "REQUIREMENTS.toml"), 30.0))
register("dataset", Kind("dataset.toml", _texts(DATASET), _dataset))
for _name, _content in (("static", STATIC), ("range", RANGE), ("transient", TRANSIENT),
                        ("coupon", COUPON)):
    register(_name, Kind(f"{_name}.csv", _texts(_content), _dataset))
register("signal", Kind("signal.csv", _texts(SIGNAL),
                        lambda folder: read_signal(folder / "signal.csv")))
