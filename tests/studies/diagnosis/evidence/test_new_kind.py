"""A kind of evidence that a test registers: it works from its file to the page."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np
import pytest

from tests.oracles.readings import swinging
from tests.oracles.readings.round_actuators import Hidden
from tests.support.datasets import write_dataset
from tests.support.library import library_of
from tympan.base.arrays import Array, Numbers
from tympan.base.toml_reader import POSITIVE
from tympan.reports.diagnosis.page import build_diagnosis_page
from tympan.studies.columns import Column
from tympan.studies.data.dataset import FILES, SPECIMEN, Dataset, read_dataset
from tympan.studies.diagnosis.calibration import calibrated
from tympan.studies.diagnosis.diagnose import diagnose
from tympan.studies.diagnosis.evidence import registry
from tympan.studies.diagnosis.evidence.kind import FilmsUnderLoads, PlateEvidence, numbers_of
from tympan.studies.diagnosis.reading_table import UNITS, ReadingTable, States, Unit, rows
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.diagnosis.result import Diagnosis
from tympan.studies.effects import Setup

#: Columns of its file, which a line of FILES declares.
COLUMNS = (SPECIMEN, Column("mass", "g"), Column("voltage", "kV"),
           Column("stiffness", rule=POSITIVE))
#: Share of each stiffness that it is known to.
NOISE = 0.01
HEAD = "specimen,mass_g,voltage_kV,stiffness\n"


class Stiffnesses(PlateEvidence):
    """Stiffness of film and rig against small forces on the plate [N/m]."""

    files = ("strange.csv",)
    kinds = ("stiffness",)
    units: ClassVar = {"stiffness": Unit("N/m", 1.0)}

    def read(self, dataset: Dataset, setup: Setup) -> tuple[list[ReadingTable], list[str]]:
        read = dataset.more.get("strange.csv")
        if read is None:
            return [], []
        states = States.of(numbers_of(setup, read.specimen), read.mass, read.voltage,
                           run=np.arange(len(read)))
        return [rows(states, "stiffness", NOISE * read.stiffness, read.stiffness,
                     file=read.file.name, line=read.line)], []

    def shown(self, films: FilmsUnderLoads, kind: str, rows: Numbers, deflection: Array) -> Array:
        return np.asarray(films.stiffness(deflection)[films.table.state[rows]])


@pytest.fixture
def stiffnesses() -> Iterator[None]:
    """The kind, registered while a test runs."""
    tables = FILES, registry.BY_ROWS, UNITS
    before = [dict(table) for table in tables]
    FILES["strange.csv"] = COLUMNS
    registry.register(Stiffnesses())
    yield
    registry.PLATES.pop()
    for table, old in zip(tables, before, strict=True):
        table.clear()
        table.update(cast(Any, old))


def written(folder: Path, gain: float) -> Path:
    """Deflections by an independent solver, times a gain; and stiffnesses of the same film."""
    swinging.write(folder, Hidden(), seed=4, swings=False)
    head, *read = (folder / "static.csv").read_text().splitlines()
    of_one = [line for line in read if line.startswith("middle,")]
    (folder / "static.csv").write_text("\n".join([head, *of_one]) + "\n")
    readings = prepared_readings(read_dataset(folder))
    nominal = calibrated(readings.setup, readings.table)
    cells = [line.rpartition(",") for line in of_one]
    (folder / "static.csv").write_text("\n".join(
        [head, *(f"{state},{gain * float(value):.9g}" for state, _, value in cells)]) + "\n")
    states = [state for state, _, _ in cells[::3]]
    (folder / "strange.csv").write_text(HEAD + "".join(f"{state},5\n" for state in states))
    table = prepared_readings(read_dataset(folder)).table
    shown = nominal.simulation.predict((), nominal.fit.unknowns, table)
    exact = shown[table.kind == "stiffness"]
    noisy = exact * (1 + NOISE * np.random.default_rng(4).standard_normal(len(exact)))
    (folder / "strange.csv").write_text(HEAD + "".join(
        f"{state},{value:.6g}\n" for state, value in zip(states, noisy.tolist(), strict=True)))
    return folder


@pytest.mark.usefixtures("stiffnesses")
def test_a_new_kind_of_evidence_is_read_weighed_told_and_drawn(tmp_path: Path) -> None:
    """A sensor's gain is a softer film by deflections alone; by stiffnesses it is not."""
    data = written(tmp_path / "data", 1.1)
    with library_of("sensor_gain", "sensor_zero"):
        result = diagnose(read_dataset(data))
    assert result.verdict == "named"
    named, = (cause for cause in result.causes if cause.named)
    (size,) = named.parameters.values()
    assert named.effect == "sensor_gain"
    assert size.low is not None
    assert size.high is not None
    assert size.low < 0.1 < size.high
    missed, = result.misfit.others
    read = read_dataset(data).more["strange.csv"].stiffness
    assert (missed.kind, missed.unit, missed.readings) == ("stiffness", "N/m", len(read))
    assert missed.noise == pytest.approx(NOISE * np.sqrt(np.mean(read**2)), rel=0.5)
    result.save(tmp_path / "out")
    assert ",stiffness," in (tmp_path / "out" / "readings.csv").read_text()
    assert Diagnosis.load(tmp_path / "out").json() == result.json()
    page, *_ = build_diagnosis_page(result, tmp_path / "out")
    assert "stiffness" in page.read_text(encoding="utf-8")


def test_a_file_of_no_kind_is_remarked_on(tmp_path: Path) -> None:
    """The same file, where nobody registers its kind."""
    data = swinging.write(tmp_path / "d", Hidden(), seed=4, swings=False)
    (data / "strange.csv").write_text(HEAD)
    dataset = read_dataset(data)
    assert not dataset.more
    assert any(remark.startswith("strange.csv is not read") for remark in dataset.remarks)


def test_a_kind_without_declared_columns_is_refused() -> None:
    with pytest.raises(ValueError, match=r"columns of strange\.csv in FILES"):
        registry.register(Stiffnesses())


def test_the_columns_of_all_kinds_are_declared_below_them() -> None:
    assert {name for kind in registry.PLATES for name in kind.files} <= FILES.keys()


@pytest.mark.parametrize("call", ["print(tympan.data(sys.argv[1]))",
                                  "tympan.cli.main(['data', sys.argv[1], '--json'])"])
def test_whoever_reads_a_dataset_needs_no_kinds(call: str, tmp_path: Path) -> None:
    """In a fresh process, by both doors: a file is known by the line that declares its columns."""
    data = write_dataset(tmp_path / "data", specimens=("A",),
                         static="specimen,mass_g,voltage_kV,displacement_mm\nA,10,0,1.4\n")
    (data / "strange.csv").write_text(HEAD + "A,10,0,5\n")
    declared = ("from tympan.studies.data.dataset import FILES, SPECIMEN; "
                "from tympan.studies.columns import Column; FILES['strange.csv'] = (SPECIMEN, "
                "Column('mass', 'g'), Column('voltage', 'kV'), Column('stiffness'))")
    none = "assert 'tympan.studies.diagnosis.evidence.registry' not in sys.modules"
    done = subprocess.run([sys.executable, "-c",
                           f"import sys, tympan, tympan.cli; {declared}; {call}; {none}",
                           str(data)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "strange.csv is not read" not in done.stdout
    assert "strange" in done.stdout
