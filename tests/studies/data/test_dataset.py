"""Datasets: every file read back, every message exact, the noise of repeats, and the command."""

from __future__ import annotations

import hashlib
import json
import re
import tempfile
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from tests.support.datasets import HEAD, write_dataset
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.studies.columns import Column, read_sheet
from tympan.studies.data import dataset
from tympan.studies.data.checks import dataset_warnings, summary
from tympan.studies.data.dataset import read_dataset
from tympan.studies.data.noise import (
    range_sigma,
    reading_sigma,
    repeat_noise,
    stated_noise,
    stated_ratio,
)
from tympan.studies.estimation.noise import Noise
from tympan.studies.shipped import actuators

TOP = "specimen,mass_g,voltage_kV,displacement_mm\n"
STRIPS = "mode,stretch,nominal_stress_kPa\n"
ROW = "A,17.9,3.5,2.4\n"
#: The SI value of units a column's name may carry, written down here a second time.
UNITS = {
    "mass": {"g": 1e-3, "kg": 1, "mg": 1e-6}, "voltage": {"kV": 1e3, "V": 1, "MV": 1e6},
    "length": {"mm": 1e-3, "m": 1, "um": 1e-6, "cm": 1e-2},
    "time": {"s": 1, "ms": 1e-3, "min": 60, "h": 3600},
    "capacitance": {"pF": 1e-12, "nF": 1e-9, "F": 1},
    "angle": {"mrad": 1e-3, "rad": 1, "deg": np.pi / 180},
    "stress": {"kPa": 1e3, "Pa": 1, "MPa": 1e6},
    "frequency": {"Hz": 1, "kHz": 1e3, "mHz": 1e-3},
    "current": {"uA": 1e-6, "mA": 1e-3, "A": 1},
    "force": {"mN": 1e-3, "N": 1, "kN": 1e3},
}
#: Between which numbers are drawn, where columns have limits of their own.
LIMITS = {"quality": (0.51, 1e3), "stretch": (0.05, 20),
          **dict.fromkeys(("displacement", "range", *"xyuv"), (1e-9, 10))}
FILES = {Path(name).stem: columns for name, columns in dataset.FILES.items()}


def values_for(column: Column, rows: int) -> st.SearchStrategy[list]:  # type: ignore[type-arg]
    """SI values, or texts, of one column; None is a blank cell."""
    if column.choices is not None:
        texts = st.sampled_from(column.choices or ("A", "B"))
        return st.lists(texts if column.required else texts | st.none(), min_size=rows,
                        max_size=rows)
    low, high = LIMITS.get(column.name, (1e-9, 50))
    numbers = st.floats(low, high, allow_subnormal=False)
    return st.lists(numbers if column.required else numbers | st.none(), min_size=rows,
                    max_size=rows)


@st.composite
def sheets(draw, columns: tuple[Column, ...]) -> tuple[str,
                                                       dict[str,
                                                            list]]:  # type: ignore[type-arg, no-untyped-def]
    """A file's text, columns in any order and unit, and the SI values in it."""
    rows = draw(st.integers(1, 5))
    kept = draw(st.permutations([column for column in columns if column.required
                                 or draw(st.booleans())]))
    meant, cells = {}, []
    for column in kept:
        values = meant[column.name] = draw(values_for(column, rows))
        if column.choices is None and column.unit:
            unit = draw(st.sampled_from(sorted(UNITS[column.dimension])))
            factor = UNITS[column.dimension][unit]
            cells.append([f"{column.name}_{unit}",
                          *("" if value is None else repr(value / factor) for value in values)])
        else:
            cells.append([column.name, *("" if value is None else str(value) for value in values)])
    end = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    mark = draw(st.sampled_from(["", "\ufeff"]))
    return mark + end.join(",".join(row) for row in zip(*cells, strict=True)) + end, meant


@pytest.mark.parametrize("name", FILES)
@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_columns_in_any_order_and_unit_are_read_back(name: str, data: st.DataObject) -> None:
    text, meant = data.draw(sheets(FILES[name]))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.csv"
        file.write_bytes(text.encode())
        sheet = read_sheet(file, FILES[name])
    assert sheet.sha256 == hashlib.sha256(text.encode()).hexdigest()
    for column in FILES[name]:
        blank = np.nan if column.choices is None else ""
        wanted = [blank if value is None else value
                  for value in meant.get(column.name, [None] * len(sheet.line))]
        if column.choices is None:
            assert sheet[column.name] == pytest.approx(np.array(wanted, float), rel=1e-14, abs=0,
                                                       nan_ok=True)
        else:
            assert sheet[column.name].tolist() == wanted


def test_a_rig_may_be_a_file_of_its_own_in_the_folder(tmp_path) -> None:
    folder = write_dataset(tmp_path / "d", HEAD.replace("\n", '\nrig = "bench.toml"\n', 1),
                           static=TOP + ROW)
    with pytest.raises(InputError, match=r"bench\.toml"):
        read_dataset(folder)
    (folder / "bench.toml").write_text('spring = "5 N/m"\n')
    assert read_dataset(folder).rig.spring == 5
    (folder / "bench.toml").write_text('spring = "5 mm"\n')
    with pytest.raises(InputError, match=r"bench\.toml: spring: given '5 mm'"):
        read_dataset(folder)


def test_every_field_of_a_dataset_is_the_one_of_its_column(tmp_path) -> None:
    """Distinct numbers everywhere, so that no two columns can change places."""
    data = read_dataset(write_dataset(
        tmp_path / "d",
        HEAD + 'noise = "50 um"\nsource = "lab book 7"\n'
               '[rig]\ngravity = "9.81 m/s^2"\nspring = "5 N/m"\n',
        static="tilt_mrad,film_voltage_kV,capacitance_pF,sigma_mm,dwell_min,direction,elapsed_s,order,"
               "repeat,run,displacement_mm,"
               "voltage_kV,mass_g,specimen\n\n1,2,3,4,0.5,down,5,6,seventh,eighth,9,10,11,B\n,,,,,,,,,,-1,0,2,A\n",
        range="specimen,mass_kg,voltage_min_V,voltage_max_kV,range_um\nB,0.5,1,2,3\n",
        transient="rest_min,current_uA,specimen,mass_g,run,t_min,film_voltage_kV,voltage_kV,"
                  "displacement_mm\n1,6,A,1,x,2,5,3,4\n",
        coupon="mode,stretch,nominal_stress_kPa,run,t_s,specimen\nuniaxial,2,35,r,4,strip\n",
        frequency="quality,mode,frequency_kHz,sigma_Hz,voltage_kV,mass_g,specimen\n"
                  "9,heave,0.011,0.5,2,7,B\n"))
    assert (data.name, data.source, data.noise) == ("test", "lab book 7", pytest.approx(50e-6))
    assert (data.rig.gravity, data.rig.spring) == (9.81, 5)
    assert [specimen.name for specimen in data.specimens] == ["A", "B"]
    static, ranges, transients, coupons, frequencies = data.tables.values()
    first = {name: values[0] for name, values in (static.values | {"line": static.line}).items()
             if values[0] == values[0]}
    assert first == {
        "specimen": "B", "mass": pytest.approx(11e-3), "voltage": 10e3,
        "displacement": pytest.approx(9e-3),
        "run": "eighth", "repeat": "seventh", "order": 6, "elapsed": 5, "direction": "down",
        "sigma": pytest.approx(4e-3), "dwell": 30, "capacitance": pytest.approx(3e-12),
        "film_voltage": 2e3, "tilt": pytest.approx(1e-3), "drive": "", "line": 3}
    assert dataset.channels(static) == ("capacitance", "film_voltage", "tilt")
    assert static.line.tolist() == [3, 4]
    assert [values[0] for values in ranges.values.values()][:5] == [
        "B", 0.5, 1, 2e3, pytest.approx(3e-6)]
    assert [values[0] for values in transients.values.values()] == [
        "A", pytest.approx(1e-3), "x", 120, 3e3, pytest.approx(4e-3), 60, 5e3,
        pytest.approx(6e-6), ""]
    assert transients.line[0] == 2
    assert (coupons.stress[0], coupons.time[0], coupons.run[0]) == (35e3, 4, "r")
    assert [values[0] for values in frequencies.values.values()] == [
        "B", pytest.approx(7e-3), 2e3, "heave", pytest.approx(11), 9, 0.5, ""]
    for name, sha256 in data.files.items():
        assert sha256 == hashlib.sha256((tmp_path / "d" / name).read_bytes()).hexdigest()
    assert list(data.files) == ["dataset.toml", *data.tables]


RANGES = "specimen,mass_g,voltage_min_kV,voltage_max_kV,range_mm\n"
SWINGS = "specimen,mass_g,voltage_kV,mode,frequency_Hz\n"
STATIC_MESSAGES = [
    ("", "static.csv: is empty"),
    (TOP, "static.csv: has no readings below"),
    (b"specimen,\xff\n", "column 2: given '\u00ff': unknown column"),
    (b"specimen,\n\x00\n", "line 2: given '\\x00': is no text: save it as CSV in UTF-8"),
    (b"\xef\xbb\xbfspecimen,\xff\n", "static.csv: is not UTF-8 text (byte 9)"),
    (TOP + 'A,17.9,0,"1,640"\n', "given '1,640': must be a number without a thousands separator "
     "and with a decimal point: 1640 or 1.640"),
    (TOP + 'A,17.9,0,"1,234,567.8"\n', "must be a number without thousands separators"),
    ("specimen;mass_g;voltage_kV;displacement_mm\nA;17,9;0;1.640,5\n",
     "line 2, column 4 (displacement_mm): given '1.640,5': must be a number"),
    ("specimen\tmass_g\n", "the columns voltage_kV, displacement_mm are missing"),
    ("specimen,mass_g,voltage_kV\n",
     "static.csv: line 1: given 'specimen, mass_g, voltage_kV': the column "
                                     "displacement_mm is missing"),
    ("specimen,mass_g\n", "the columns voltage_kV, displacement_mm are missing"),
    ("specimen,mass_g,volatge_kV,displacement_mm\n",
     "line 1, column 3: given 'volatge_kV': unknown column: did you mean 'voltage_kV'? "
     "known are specimen, mass_g"),
    ("Specimn,mass_g\n", "column 1: given 'Specimn': unknown column: did you mean 'specimen'?"),
    ("specimen,mass,voltage_kV\n",
     "column 2: given 'mass': has no unit: write it into the name, such as mass_g"),
    ("specimen,mass_mm\n",
     "column 2: given 'mass_mm': wrong dimension: must be a unit of mass, such as g"),
    ("specimen,voltage_kVolts\n",
     "column 2: given 'voltage_kVolts': unknown unit: did you mean 'kV'? "
     "must be a unit of voltage"),
    ("specimen,mass_g,mass_g\n", "column 3: given 'mass_g': is there twice"),
    ("specimen,mass_g,mass_kg\n", "column 3: given 'mass_kg': one column of mass only"),
    ("specimen,mass_g,\n", "line 1, column 3: given '': must have a name"),
    (TOP + "C,17.9,0,1\n",
     "line 2, column 1 (specimen): given 'C': unknown specimen: those of dataset.toml are A, B"),
    (TOP + ",17.9,0,1\n", "line 2, column 1 (specimen): given '': must not be blank"),
    (TOP + ROW + "A,17.9,,1\n", "line 3, column 3 (voltage_kV): given '': must be a number"),
    (TOP + "A,17.9,7,-\n", "given '-': must be a number; leave out what was not read"),
    (TOP + "A,17.9,0,low\n", "line 2, column 4 (displacement_mm): given 'low': must be a number"),
    (TOP + "A,17.9 kg,0,1\n",
     "given '17.9 kg': must be a number alone: its unit stands in the name of the column"),
    (TOP + 'A,17.9,0,"1,64"\n',
     "given '1,64': must be a number with a decimal point, such as 1.64"),
    (TOP + "A,17,9,0,1,64\n",
     "line 2: given '6 cells': must have 4 cells, as the first line has; "
     "a decimal comma splits a number"),
    (TOP + "A,17.9,0\n", "line 2: given '3 cells': must have 4 cells, as the first line has\n"),
    (TOP + "A,17.9,0,nan\n", "column 4 (displacement_mm): given 'nan': must be finite"),
    (TOP + "A,17.9,0,1e999\n", "given '1e999': must be finite"),
    (TOP + "A,17.9,0,1_000\n", "given '1_000': must be a number"),
    (TOP + "A,17.9,-3.5,1\n",
     "column 3 (voltage_kV): given '-3.5': must be from 0 to 1000 kV; the film's pull has no"),
    (TOP + "A,17.9,3500,1\n", "given '3500': must be from 0 to 1000 kV"),
    (TOP + "A,-17.9,0,1\n", "column 2 (mass_g): given '-17.9': must be from 0 to 100 kg"),
    (TOP[:-1] + ",direction\nA,17.9,0,1,sideways\n",
     "given 'sideways': must be one of up, down, or blank"),
    (TOP[:-1] + ",sigma_mm\nA,17.9,0,1,0\n", "column 5 (sigma_mm): given '0': must be positive"),
    (TOP[:-1] + ",repeat\nA,1,0,1,1\nB,1,0,1,1\nA,1,0,1,1\n",
     "line 4, column 5 (repeat): given '1': the row is the same as line 2 in every cell"),
    (TOP + 'A,17.9,0,"1\n', "line 2: is not comma-separated text"),
]
MESSAGES = [
    ({"range": "specimen,mass_g,voltage_min_kV,voltage_max_kV,range_mm\nA,1,7,7,1\n"},
     "range.csv: line 2, column 4 (voltage_max_kV): given '7': must be above voltage_min"),
    ({"range": "specimen,mass_g,voltage_min_kV,voltage_max_kV,range_mm\nA,1,0,7,-1\n"},
     "given '-1': must not be neg"),
    ({"range": "specimen,mass_g,voltage_min,voltage_max_kV\n"}, "given 'voltage_min': has no unit"),
    ({"transient": "specimen,mass_g,run,t_s,voltage_kV,displacement_mm\n"
                   "A,1,1,0,0,1\nA,1,2,0,0,1\nA,1,1,0.0,0,2\n"},
     "transient.csv: line 4, column 4 (t_s): given '0.0': must be there once in a run: "
     "it stands in line 2 too"),
    ({"coupon": "mode,stretch,nominal_stress_kPa\nbiaxial,2,3\n"},
     "coupon.csv: line 2, column 1 (mode)"),
    ({"frequency": SWINGS + "A,17.9,0,tilt,11\n"},
     "frequency.csv: line 2, column 4 (mode): given 'tilt': must be one of heave"),
    ({"frequency": SWINGS + "A,17.9,0,heave,0\n"}, "given '0': must be above 0 Hz"),
    ({"frequency": SWINGS.replace("_Hz", "_rpm") + "A,17.9,0,heave,660\n"},
     "column 5: given 'frequency_rpm'"),
    ({"frequency": SWINGS[:-1] + ",quality\nA,17.9,0,heave,11,0.4\n"},
     "given '0.4': must be above 0.5: a plate more damped does not swing"),
    ({"frequency": SWINGS[:-1] + ",sigma_Hz\nA,17.9,0,heave,11,0\n"},
     "column 6 (sigma_Hz): given '0': must be positive"),
    ({"frequency": SWINGS + "C,17.9,0,heave,11\n"}, "given 'C': unknown specimen"),
    ({}, f"must hold at least one of {', '.join(dataset.FILES)}\n"),
    ({"statics": TOP + ROW},
     f"one of {', '.join(dataset.FILES)}; there: statics.csv\n"),
    ({"head": HEAD + "colour = 1\n", "static": TOP + ROW}, "dataset.toml: colour: unknown key"),
    ({"specimens": ('A"\nnoise = "20 um',), "static": TOP + ROW},
     "dataset.toml: specimen.0.noise: unknown key: it belongs to the top of the file"),
    ({"head": "", "static": TOP + ROW}, "dataset.toml: name: is missing"),
    ({"head": HEAD + 'noise = "0 mm"\n', "static": TOP + ROW},
     "dataset.toml: noise: given '0 mm': must be positive"),
    ({"head": HEAD + 'noise = 0.05\n', "static": TOP + ROW},
     "dataset.toml: noise: given 0.05: has no unit"),
    ({"head": HEAD + 'gravity = "9.81 m/s^2"\n[rig]\n', "static": TOP + ROW},
     "gravity: given '9.81 m/s^2': must"),
    ({"specimens": (), "static": TOP + ROW},
     "dataset.toml: specimen: is missing: write one [[specimen]] table"),
    ({"specimens": ("A", "A"), "static": TOP + ROW},
     "dataset.toml: specimen.0.name: given 'A': is there twice"),
    ({"specimens": ("A", "/"), "static": TOP + ROW}, "dataset.toml: specimen.1.name: given '/'"),
    ({"specimens": ("alpha", "beta"), "static": TOP + "alhpa,1,0,1\n"},
     "unknown specimen: did you mean 'alpha'?"),
]


@pytest.mark.parametrize(("parts", "message"),
                         [*(({"static": text}, words) for text, words in STATIC_MESSAGES),
                                                *MESSAGES])
def test_bad_data_end_with_one_message_and_status_2(tmp_path, capsys, parts, message: str) -> None:
    folder = write_dataset(tmp_path / "d", **parts)
    assert main(["data", str(folder)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert message in err


def test_a_dataset_may_be_told_by_its_dataset_toml(tmp_path) -> None:
    folder = write_dataset(tmp_path, specimens=("A",), static=TOP + ROW)
    told, plain = read_dataset(folder / "dataset.toml"), read_dataset(folder)
    assert told.files == plain.files
    assert len(told.sheets) == 1


def test_a_dataset_may_name_its_specimens_files(tmp_path) -> None:
    whole = write_dataset(tmp_path / "whole", specimens=("A", "B"), static=TOP + ROW)
    head, *tables = (whole / "dataset.toml").read_text().split("[[specimen]]\n")
    named = write_dataset(tmp_path / "named", specimens=(), static=TOP + ROW)
    (tmp_path / "a.toml").write_text(tables[0].replace("[specimen.", "["))
    entry = '[[specimen]]\nfile = "../a.toml"\n'
    (named / "dataset.toml").write_text(f"{head}{entry}[[specimen]]\n{tables[1]}")
    data = read_dataset(named)
    assert data.specimens == read_dataset(whole).specimens
    digest = hashlib.sha256((tmp_path / "a.toml").read_bytes()).hexdigest()
    assert data.files["../a.toml"] == digest


def test_rows_without_a_specimen_are_of_the_only_one(tmp_path, capsys) -> None:
    tables = {"static": TOP + ROW, "range": RANGES + "A,1,0,7,1\n",
              "frequency": SWINGS + "A,17.9,0,heave,11\n",
              "transient": "specimen,mass_g,run,t_s,voltage_kV,displacement_mm\nA,1,1,0,0,1\n",
              "field": "specimen,mass_g,voltage_kV,x_mm,y_mm,displacement_mm\nA,1,0,0,0,1\n",
              "force": "specimen,voltage_kV,displacement_mm,force_mN\nA,0,1,2\n"}
    bare = {name: re.sub("(?m)^(specimen|A),", "", table) for name, table in tables.items()}
    whole = read_dataset(write_dataset(tmp_path / "whole", specimens=("A",), **tables))
    read = read_dataset(write_dataset(tmp_path / "bare", specimens=("A",), **bare))
    assert len(read.tables) == len(tables)
    for name, sheet in whole.tables.items():
        for column, values in sheet.values.items():
            np.testing.assert_array_equal(read.tables[name].values[column], values)
    # Of two the table must say which; the line that the message asks for does.
    two = write_dataset(tmp_path / "two", static=bare["static"])
    assert main(["data", str(two)]) == 2
    line = re.search(r"the column specimen is missing: .* (\[columns\.static\]): (specimen = .*)",
                     capsys.readouterr().err)
    assert line is not None
    head = HEAD + "\n".join(line.groups()) + "\n"
    read = read_dataset(write_dataset(two, head, static=bare["static"]))
    assert read.static is not None
    assert read.static.specimen.tolist() == ["A"]


@pytest.mark.parametrize(("entry", "specimen", "message"), [
    ('file = "a.toml"', 'name = "A"\nfram = 1\n', "a.toml: frame: is missing: did you mean it by"),
    ('file = "a.toml"', 'name = "A"\n', "a.toml: frame: is missing"),
    ('file = "none.toml"', "", "none.toml: cannot be read: No such file or directory"),
    ('file = "a.toml"\nname = "A"', "", "dataset.toml: specimen.0.file: given 'a.toml': must stand "
     "alone, or the specimen's own keys without it: there is also name"),
    ('file = 3', "", "dataset.toml: specimen.0.file: given 3: must be a non-empty string"),
    ('name = "A"\nfil = "a.toml"', "", "dataset.toml: specimen.0.frame: is missing"),
])
def test_a_specimen_s_file_that_cannot_be_used_is_named(tmp_path, capsys, entry: str, specimen: str,
                                                        message: str) -> None:
    folder = write_dataset(tmp_path / "d", specimens=(), static=TOP + ROW)
    with (folder / "dataset.toml").open("a") as file:
        file.write(f"[[specimen]]\n{entry}\n")
    if specimen:
        (folder / "a.toml").write_text(specimen)
    assert main(["data", str(folder)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert message in err


def test_folders_that_cannot_be_read(tmp_path, capsys) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").touch()
    for name, message in (("none", "must be a folder with dataset.toml"),
                          ("file", "must be a folder"),
                          ("emtpy", "did you mean 'empty'?"),
                          ("empty", "dataset.toml: cannot be read: No such file")):
        assert main(["data", str(tmp_path / name)]) == 2
        assert message in capsys.readouterr().err
    (write_dataset(tmp_path / "d") / "static.csv").mkdir()
    with pytest.raises(InputError, match=r"static\.csv: cannot be read"):
        read_dataset(tmp_path / "d")


RAMP = TOP[:-1] + ",order,direction\n" + "".join(
    f"{name},{mass},{volts},{2 + 0.2 * volts + 0.01 * order},{order},{way}\n" for name in "AB"
    for mass in (17.9, 22.45)
    for order, (volts, way) in enumerate([(0, "up"), (3, "up"), (5, "up"), (3, "down"),
                                          (0, "down")]))
UP = RAMP.replace("down", "up")
SNAPS = '[[rig.bias]]\nlaw = "bistable"\nforce = "0.5 N"\ntravel = "6 mm"\n'
NOISY = HEAD + 'noise = "50 um"\n'
WARNINGS = [
    ({"static": TOP + ROW, "statics": "x"}, "statics.csv is not read: did you mean static.csv?"),
    ({"static": TOP + ROW, "notes": "x"}, "notes.csv is not read: known are static.csv"),
    ({"static": TOP + ROW}, "no readings of B"),
    ({"static": TOP + ROW}, "one specimen only"),
    ({"static": TOP + ROW}, "one mass only"),
    ({"static": TOP + ROW}, "one voltage only"),
    ({"static": TOP + ROW + "B,17.9,0,1\n"}, "2 readings only"),
    ({"static": TOP + ROW}, "neither order nor elapsed_s is recorded"),
    ({"static": TOP + ROW}, "direction is not recorded"),
    ({"static": TOP + ROW}, "nothing repeats and no noise is given"),
    ({"static": TOP + ROW + ROW},
     "1 rows are the same as an earlier one in every cell, first line 3 as line 2"),
    ({"static": TOP + ROW + ROW}, "repeats agree to the last digit"),
    ({"static": UP}, "only up ramps: creep looks like"),
    ({"static": RAMP, "head": HEAD + SNAPS}, "a mechanism of the rig may make plates snap"),
    ({"static": UP.replace("up", "down")}, "only down ramps"),
    ({"static": TOP[:-1] + ",order\nA,1,5,3,2\nA,1,0,1,1\n"}, "only up ramps"),
    ({"static": TOP[:-1] + ",order\nA,1,5,3,1\nA,1,0,1,2\n"}, "direction is not recorded"),
    ({"static": TOP[:-1] + ",order\nA,1,5,3,1\nA,1,0,1,\n"}, "recorded for 1 of 2 readings only"),
    ({"head": NOISY, "static": TOP + "A,17.9,0,1\nA,17.9,0,3\n"},
     "repeats scatter by 28.3 times the stated noise"),
    ({"static": TOP + "A,17.9,0.5,1640\n"}, "the largest displacement of A is 1640 mm"),
    ({"static": TOP + "A,17.9,0.5,0.00164\n"}, "the largest displacement of A is 0.00164 mm"),
    ({"static": TOP + "A,0.0179,0.5,1\n"}, "the largest mass of A is 0.0179 g"),
    ({"static": TOP + "A,17900,0.5,1\n"}, "the largest mass of A is 1.79e+04 g"),
    ({"static": TOP + "A,17.9,500,1\n"}, "the largest voltage of A is 500 kV"),
    ({"static": TOP.replace("kV", "V") + "A,17.9,7,1\n"}, "the largest voltage of A is 0.007 kV"),
    ({"static": TOP + "A,17.9,0.5,1.6\nA,22.45,0.5,0.002\n"},
     "the largest displacement of A under 22.45 g is 0.002 mm"),
    ({"static": TOP[:-1] + ",capacitance_pF\nA,17.9,0.5,1.6,1.2\n"},
     "the largest capacitance of A is 1.2 pF"),
    ({"static": TOP[:-1] + ",film_voltage_V\nA,17.9,3.5,1.6,3.4\n"},
     "the largest film_voltage of A is 0.0034 kV"),
    ({"static": TOP + "".join(f"A,{mass},{volts},{min(mass * (1 + volts**2 / 30) / 10, 2.5)}\n"
                              for mass in (10, 20) for volts in range(7))},
     "4 readings are 2.5 mm, as no other value is read and none is more, first line 12"),
    ({"static": TOP[:-1] + ",order,elapsed_s\nA,1,0,1,1,0\nA,1,5,3,2,90\nA,1,5,3,3,60\n"},
     "the clock runs back at line 4, to 60 s, against the column order"),
    ({"coupon": STRIPS + "".join(f"uniaxial,{0.1 * step},{20 * step}\n" for step in range(1, 9))},
     "most of 8 readings below a stretch of 0.95 pull"),
    ({"coupon": STRIPS[:-1] + ",temperature_C\nuniaxial,2,20,293.15\n"},
     "the lowest temperature_C is 293.1: is it in kelvin?"),
    ({"range": "specimen,mass_g,voltage_min_kV,voltage_max_kV,range_mm\nA,17.9,0,7,1640\n"},
     "the largest range of A"),
    ({"frequency": SWINGS + "A,17.9,0,heave,11\n"}, "frequencies of one specimen under one mass"),
    ({"frequency": SWINGS + "A,17.9,0,heave,11\n"}, "membrane.density of A is 0"),
    ({"static": TOP + "A,17.9,0,2\n", "frequency": SWINGS + "A,17.9,0,heave,70\n"},
     "A under 17.9 g has up to 70 Hz, where a weight that rests as far down as static.csv says "
     "has about 11.1 Hz"),
]


def test_slow_loads_alike_states_and_coarse_digits_are_no_slips(tmp_path) -> None:
    """Small masses, films without load, clocks that begin again, ties by rounding."""
    rows = "".join(
        f"{name},{mass},{volts},{mass * (1 + volts**2 / 30) / 10:.1f},{order},{60 * volts}\n"
        for name in "AB"
        for order, (mass, volts) in enumerate(
            (mass, volts) for mass in (0, 0.05, 10, 20) for volts in range(7)))
    static = TOP[:-1] + ",order,elapsed_s\n" + rows
    words = " ".join(dataset_warnings(read_dataset(write_dataset(tmp_path / "d", static=static))))
    assert not [word for word in ("largest", "end", "clock", "rises") if word in words]


@pytest.mark.parametrize(("parts", "message"), WARNINGS)
def test_warnings(tmp_path, parts, message: str) -> None:
    assert any(message in words
               for words in dataset_warnings(read_dataset(write_dataset(tmp_path / "d", **parts))))


def test_a_good_dataset_has_no_warnings(tmp_path) -> None:
    assert dataset_warnings(read_dataset(write_dataset(tmp_path / "d", NOISY, static=RAMP))) == []


def test_noise_of_repeats_by_hand(tmp_path) -> None:
    """Groups {1, 3} and {5, 6, 7} of mm: squares 2 + 2 on 3 degrees; χ² limits of 3 degrees from
    tables."""
    text = TOP[:-1] + ",direction,run\n" + "".join(f"A,17.9,{row}\n" for row in (
        "0,1,up,1", "0.0,3,up,1", "5,5,up,1", "5.00,6,up,1", "5,7,up,1", "5,99,down,1",
        "5,88,up,2"))
    data = read_dataset(write_dataset(tmp_path / "d",
                                      static=text + "A,22.45,0,77,up,1\nB,17.9,0,66,up,1\n"))
    noise = repeat_noise(data)
    assert noise is not None
    assert (noise.size, noise.freedom) == (pytest.approx(1e-3 * (4 / 3) ** 0.5), 3)
    assert noise.limits[0] == pytest.approx(1e-3 * (4 / 9.348) ** 0.5, rel=1e-3)
    assert noise.limits[1] == pytest.approx(1e-3 * (4 / 0.2158) ** 0.5, rel=1e-3)
    assert reading_sigma(data) == pytest.approx(np.full(9, noise.size))


def test_a_reading_s_own_sigma_is_respected(tmp_path) -> None:
    rows = "A,1,0,1,0.5\nA,1,0,2,0.5\nA,1,3,1,\nA,1,3,1.2,\n"
    data = read_dataset(write_dataset(tmp_path / "d", static=TOP[:-1] + ",sigma_mm\n" + rows))
    noise, ratio = repeat_noise(data), stated_ratio(data)
    assert noise is not None
    assert ratio is not None
    assert (noise.size, noise.freedom) == (pytest.approx(0.2e-3 / 2**0.5), 1)
    assert (ratio.size, ratio.freedom) == (pytest.approx(2**0.5), 1)
    assert reading_sigma(data) == pytest.approx([0.5e-3, 0.5e-3, noise.size, noise.size])
    stated = read_dataset(write_dataset(tmp_path / "d", NOISY,
                                        static=TOP[:-1] + ",sigma_mm\n" + rows))
    assert reading_sigma(stated) == pytest.approx([0.5e-3, 0.5e-3, 50e-6, 50e-6])
    unknown = read_dataset(write_dataset(tmp_path / "d", static=TOP + ROW))
    assert repeat_noise(unknown) is None
    assert np.isnan(reading_sigma(unknown)).all()


def test_the_noise_that_is_stated_is_as_it_is_written(tmp_path) -> None:
    rows = "A,1,0,1,0.03\nA,1,3,2,\n"
    own = TOP[:-1] + ",sigma_mm\n" + rows
    ranges = "specimen,mass_g,voltage_min_kV,voltage_max_kV,range_mm\nA,17.9,0,7,1.6\n"
    head = HEAD + 'noise = "15 um"\n'
    for number, (top, files, expected) in enumerate((
            (head, {"static": TOP + ROW}, 15e-6), (HEAD, {"static": own}, 30e-6),
            (head, {"static": own}, ((15e-6**2 + 30e-6**2) / 2) ** 0.5),
            (head, {"range": ranges}, 2**0.5 * 15e-6), (HEAD, {"static": TOP + ROW}, None),
            (head, {"transient": "specimen,mass_g,run,t_s,voltage_kV,displacement_mm\n"
                                 "A,1,1,0,0,1\nA,1,1,1,0,1\n"}, 15e-6))):
        data = read_dataset(write_dataset(tmp_path / str(number), top, **files))
        assert stated_noise(data) == (None if expected is None else pytest.approx(expected))


def test_ranges_have_the_noise_of_a_difference_where_they_state_none(tmp_path) -> None:
    ranges = ("specimen,mass_g,voltage_min_kV,voltage_max_kV,range_mm,sigma_mm\n"
              "A,17.9,0,7,1.6,\nA,17.9,0,6,1.2,0.03\n")
    head = HEAD + 'noise = "20 um"\n'
    stated = read_dataset(write_dataset(tmp_path / "a", head, range=ranges))
    assert range_sigma(stated) == pytest.approx([2**0.5 * 20e-6, 30e-6])
    unknown = read_dataset(write_dataset(tmp_path / "b", range=ranges))
    assert np.isnan(range_sigma(unknown)).tolist() == [True, False]


@pytest.mark.parametrize("uneven", [False, True])
def test_noise_intervals_cover_as_often_as_they_say(uneven: bool) -> None:
    """Groups of 1 to 4 about distant means; limits one seed in a thousand would miss on either
    side."""
    random, trials = np.random.default_rng(5), 2000
    groups = np.repeat(np.arange(8), [1, 2, 3, 4, 1, 2, 2, 3])
    sigma = random.uniform(0.5, 2, len(groups)) if uneven else 1.0
    hits = 0
    for _ in range(trials):
        values = 1e3 * groups + 0.05 * sigma * random.standard_normal(len(groups))
        noise = Noise.pooled(values, groups, sigma)
        assert noise is not None
        assert noise.freedom == 10
        hits += noise.limits[0] < 0.05 < noise.limits[1]
    assert binom.ppf(0.001, trials, 0.95) <= hits <= binom.ppf(0.999, trials, 0.95)


def test_the_paper_s_table_2() -> None:
    folder = Path(str(resources.files("tympan.paper") / "table-2"))
    data = read_dataset(folder)
    assert data.ranges is not None
    rows = list(zip(data.ranges.specimen.tolist(), data.ranges.mass.tolist(),
                    data.ranges.range.tolist(), strict=True))
    wanted = {17.9: (1.64, 1.86, 2.06), 22.45: (1.75, 2.16, 2.37)}
    names = ("circular", "elliptical-small", "elliptical-large")
    assert rows == [(name, pytest.approx(1e-3 * mass), pytest.approx(1e-3 * value))
                    for mass, values in wanted.items()
                    for name, value in zip(names, values, strict=True)]
    assert set(data.ranges.voltage_min) == {0}
    assert set(data.ranges.voltage_max) == {7000}
    assert {specimen.name: specimen for specimen in data.specimens} == {actuator.name: actuator
                                                                        for actuator in actuators()}
    assert summary(data)["warnings"] == []


def test_the_command_says_what_is_there(tmp_path, capsys) -> None:
    text = TOP[:-1] + ",repeat\n" + "".join(
        f"A,17.9,{volts},{2 + 0.1 * volts + 0.1 * turn},{turn}\n"
        for volts in range(10) for turn in range(2))
    folder = write_dataset(tmp_path / "d", static=text, transient=(
        "specimen,mass_g,run,t_s,voltage_kV,displacement_mm\nA,1,1,0,0,1\nA,1,1,1,0,1\nB,1,1,0,0,2\n"))
    assert main(["data", str(folder), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert [file["readings"] for file in content["files"]] == [None, 20, 3]
    assert content["masses_kg"] == pytest.approx([1e-3, 17.9e-3])
    assert content["voltages_V"] == pytest.approx([1e3 * volts for volts in range(10)])
    assert (content["runs"], content["repeated_states"]) == (2, 10)
    assert content["noise"]["found_m"]["value"] == pytest.approx(1e-4 / 2**0.5)
    assert content["noise"]["found_m"]["degrees_of_freedom"] == 10
    assert main(["data", str(folder)]) == 0
    printed = capsys.readouterr().out
    assert "voltages   10 from 0 to 9 kV" in printed
    assert ("noise      from repeats: 70.71 um (95 %: 49.41 to 124.1, 10 degrees of freedom)"
            in printed)
    assert "static.csv     20 readings, SHA-256 " in printed
    assert "warning: direction is not recorded" in printed


def test_a_hundred_thousand_rows(tmp_path) -> None:
    random = np.random.default_rng(0)
    rows = "".join(f"A,17.9,{volts:.3f},{volts + noise:.6f}\n" for volts, noise in zip(
        np.repeat(np.linspace(0, 7, 50_000), 2), 0.05 * random.standard_normal(100_000),
        strict=True))
    data = read_dataset(write_dataset(tmp_path / "d", static=TOP + rows))
    noise = repeat_noise(data)
    assert data.static is not None
    assert data.static.line[-1] == 100_001
    assert noise is not None
    assert noise.limits[0] < 50e-6 < noise.limits[1]
    assert summary(data)["files"][1]["readings"] == 100_000


def test_runs_in_time_tell_drift_from_the_voltage(tmp_path) -> None:
    """Of readings at rest beside them nobody need know when they were made."""
    run = "specimen,mass_g,run,t_s,voltage_kV,displacement_mm\nA,17.9,1,0,0,1\nA,17.9,1,1,3,1.2\n"
    for files, said in (({}, True), ({"transient": run}, False)):
        folder = write_dataset(tmp_path / f"d{said}", static=TOP + ROW, **files)
        warnings = dataset_warnings(read_dataset(folder))
        assert any("neither order nor elapsed_s" in words for words in warnings) is said
