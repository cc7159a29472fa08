"""One more field of a result is one line: it is in JSON, CSV, text, notebook, xarray and docs."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import pytest

from tympan.base.fields import Key
from tympan.reports.schema import class_keys
from tympan.reports.tables import dataset, html, table, text
from tympan.result import Result
from tympan.studies.case import CaseRecord, Warnings
from tympan.studies.columns import as_written, write_rows
from tympan.studies.force import ForceResult
from tympan.studies.force.result import ForceCurve
from tympan.studies.rows import rows_in


@dataclass(frozen=True, kw_only=True)
class Ramp:
    voltage_V: Annotated[float, Key("nominal voltage")]
    deflection_m: Annotated[tuple[float, ...], Key("deflections")]
    stretch: Annotated[tuple[float | None, ...], Key("stretches")]


@dataclass(frozen=True, kw_only=True)
class RampResult(CaseRecord):
    ending = "-ramp"
    writer = "a test"
    kinds = ("csv", "json")
    indexed = ("voltage_V", "deflection_m")

    ramps: Annotated[tuple[Ramp, ...], Key("ramps")] = ()
    warnings: Warnings = ()

    @property
    def rows(self) -> dict[str, Any]:
        return rows_in(self.ramps, specimen=self.specimen)

    def save(self, folder: Path) -> None:
        super().save(folder)
        write_rows(folder / f"{self.specimen}-ramp.csv", self.rows)


@dataclass(frozen=True, kw_only=True)
class RampWithForce(Ramp):
    force_N: Annotated[tuple[float, ...], Key("forces of the film")]


@dataclass(frozen=True, kw_only=True)
class WiderResult(RampResult):
    ramps: Annotated[tuple[RampWithForce, ...], Key("ramps")] = ()


RAMPS = tuple(RampWithForce(voltage_V=voltage, deflection_m=(0.0, 1e-3), stretch=(2.0, None),
                            force_N=(0.1, 0.25)) for voltage in (1e3, 2e3))
WIDER = WiderResult(specimen="oval", mass_kg=0.01, voltage_V=2e3, ramps=RAMPS)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    WIDER.save(tmp_path)
    return tmp_path


def test_one_line_more_is_in_the_files(folder: Path) -> None:
    stored = json.loads((folder / "oval-ramp.json").read_text(encoding="utf-8"))
    assert [ramp["force_N"] for ramp in stored["ramps"]] == [[0.1, 0.25]] * 2
    assert WiderResult.load(folder) == WIDER
    assert (folder / "oval-ramp.csv").read_text(encoding="utf-8") == (
        "specimen,voltage_kV,deflection_mm,stretch,force_mN\n"
        "oval,1,0,2,100\noval,1,1,,250\noval,2,0,2,100\noval,2,1,,250\n")


def test_it_is_in_tables_with_its_unit() -> None:
    assert table(WIDER)["force_N"].tolist() == [0.1, 0.25] * 2
    shown = dataset(WIDER)
    assert shown["force_N"].attrs == {"units": "N"}
    assert shown["force_N"].sel(voltage_V=2e3, deflection_m=1e-3) == 0.25
    assert "force_N" in text(WIDER)
    assert "<th>force_N</th>" in html(WIDER)
    result = Result(WIDER)
    assert "force_N" in repr(result)
    assert result.to_pandas()["force_N"].max() == 0.25


def test_single_numbers_stand_above_the_table() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Judged(WiderResult):
        headline: Annotated[str, Key("what it comes to")] = "the film agrees " * 12
        gain: Annotated[float | None, Key("gain")] = None
        work_J: Annotated[float, Key("work")] = 1.25e-5
        wall_s: Annotated[float, Key("time")] = 3.0

    found = Judged(specimen="oval", mass_kg=0.01, voltage_V=2e3, ramps=RAMPS)
    above, below = text(found).split("\n\n")
    lines = above.splitlines()
    assert max(map(len, lines)) <= 100
    names = [line.split()[0] for line in lines if line[0] != " "]
    assert names == ["mass_kg", "headline", "work_J"]
    assert lines[-1].split() == ["work_J", "1.25e-05", "J"]
    assert "deflection_m" in below
    assert "<td>1.25e-05</td>" in html(found)
    assert found.headline.strip() in html(found)


def test_a_table_without_rows_is_a_sentence() -> None:
    nothing = WiderResult(specimen="oval", mass_kg=0.01, voltage_V=2e3)
    assert repr(Result(nothing)).splitlines() == [
        "WiderResult", "specimen   oval", "mass_kg    0.01 kg", "voltage_V  2000 V", "",
        "The table of this result has no rows."]
    assert "<p>The table of this result has no rows.</p>" in html(nothing)


def test_a_result_names_its_own_key_numbers() -> None:
    class Named(WiderResult):
        @property
        def key_numbers(self) -> dict[str, float]:
            return {f"of_{number}_m": float(number) for number in range(20)}

    above, _ = text(Named(specimen="oval", mass_kg=0.01, voltage_V=2e3,
                          ramps=RAMPS)).split("\n\n")
    assert above.splitlines()[1] == "of_1_m   1 m"
    assert len(above.splitlines()) == 15


def test_it_is_in_the_schema() -> None:
    key, = [key for key in class_keys(WiderResult) if key.path == "ramps[].force_N"]
    assert key.meaning == "forces of the film"
    assert key.unit == "N"


def test_a_film_s_own_number_is_in_all_of_them_too(tmp_path: Path) -> None:
    @dataclass(frozen=True, kw_only=True)
    class WithArea(CaseRecord):
        ending = "-area"
        writer = "a test"
        area_m2: Annotated[float, Key("area of the frame")]

    found = WithArea(specimen="oval", mass_kg=0.01, voltage_V=2e3, area_m2=0.008)
    found.save(tmp_path)
    assert json.loads((tmp_path / "oval-area.json").read_text())["area_m2"] == 0.008
    assert "area_m2 0.008  m^2" in text(found)
    assert "<td>m^2</td>" in html(found)
    assert Result(found).save(tmp_path / "a.csv").read_text().splitlines()[0].endswith("area_m2")


def test_the_columns_of_forces_are_the_fields_of_their_curves(tmp_path: Path) -> None:
    """A number of each kind: nothing names the columns a second time."""
    lists = {item.name: (1.5,) for item in fields(ForceCurve)
             if item.name not in ("voltage_V", "segment_voltages_V", "limits", "ended",
                                  "band_force_N")}
    curve = ForceCurve(voltage_V=1e3, limits=(), ended=None, **lists)  # type: ignore[arg-type]
    result = ForceResult(specimen="oval", curves=(curve,), dofs=1, wall_s=0.0)
    result.save(tmp_path)
    rows = pd.read_csv(tmp_path / "oval-force.csv")
    assert rows.shape == (1, 2 + len(lists))
    assert list(table(result).columns) == ["specimen", "voltage_V", *lists]


def test_written_values_are_those_that_are_read_back() -> None:
    from tympan.tables.column import Column

    value = 1.2345678901234567e-3
    written = as_written([Column("deflection", "mm"), Column.labels("of")],
                         {"deflection": [value, float("nan")], "of": ["a", "b"]})
    assert written["deflection"][0] == float(f"{value / 1e-3:.12g}") * 1e-3 != value
    assert written["deflection"][1] != written["deflection"][1]
    assert written["of"].tolist() == ["a", "b"]
