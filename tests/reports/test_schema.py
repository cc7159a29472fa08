"""What commands print is what the reference says of it: keys, kinds, units."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.checks.json_schema import faults
from tests.support.specimens import specimen_toml
from tympan.cli import main
from tympan.reports import schema
from tympan.reports.schema import JsonKey, json_records
from tympan.studies.alpha.table import OutlineRow, OutlineTable

RECORDS = {record.name: record for record in json_records()}
LOADS = ("--mass", "17.9 g", "--voltage", "2 kV")
COARSE = ("--refine", "0.5")
BRANCH = '[[membrane.branch]]\nmodulus = "31.2 kPa"\ntime = "6.5 s"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with specimens, one with a viscous branch, and a sweep."""
    place = tmp_path_factory.mktemp("schema")
    (place / "oval.toml").write_text(specimen_toml(), encoding="utf-8")
    (place / "creep.toml").write_text(specimen_toml("creep") + BRANCH, encoding="utf-8")
    (place / "SWEEP.toml").write_text('specimen = "oval.toml"\nmass = "17.9 g"\nvoltage = "1 kV"\n'
                                      '[grid]\n"plate.radius" = ["1 cm"]', encoding="utf-8")
    return place


#: Commands, and the record each prints; a few of states that do not exist, too.
PRINTED = [
    ("solve", "solve oval.toml", LOADS),
    ("solve", "solve oval.toml", ("--mass", "17.9 g", "--voltage", "40 kV")),
    ("limits", "limits oval.toml", ("--mass", "17.9 g")),
    ("curve", "curve oval.toml", ("--mass", "17.9 g", "--voltage", "1 kV")),
    ("path", "path oval.toml", LOADS),
    ("modes", "modes oval.toml", LOADS),
    ("modes", "modes oval.toml", ("--mass", "17.9 g", "--voltage", "40 kV")),
    ("sensitivity", "sensitivity oval.toml", LOADS),
    ("alpha", "alpha oval.toml", ()),
    ("response", "response creep.toml", (*LOADS, "--frequency", "1 Hz")),
    ("transient", "transient creep.toml", ("--mass", "17.9 g", "--signal", "step", "--high",
                                           "3 kV", "--duration", "1 s")),
    ("transient", "path creep.toml", ("--mass", "17.9 g", "--rate", "2 kV/s", "--to", "2 kV")),
    ("sweep", "sweep SWEEP.toml", ("-o", "swept", "--workers", "1")),
]


@pytest.mark.parametrize(("name", "command", "options"), PRINTED)
def test_real_output_is_as_declared(name: str, command: str, options: tuple[str, ...],
                                    folder: Path, monkeypatch: pytest.MonkeyPatch,
                                    capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(folder)
    main([*command.split(), *options, *COARSE, "--json"])
    printed = json.loads(capsys.readouterr().out)
    assert list(faults(printed, RECORDS[name].schema)) == []
    for path, value in numbers_of(printed):
        key = next(key for key in RECORDS[name].keys if fits(path, key))
        assert not key.unit or isinstance(value, float | int)


def numbers_of(value: Any, path: tuple[str, ...] = ()) -> list[tuple[tuple[str, ...], Any]]:
    """Every number of a record, with the steps to it."""
    if isinstance(value, dict):
        return [pair for name, entry in value.items() for pair in numbers_of(entry, (*path, name))]
    if isinstance(value, list):
        return [pair for entry in value for pair in numbers_of(entry, (*path, "[]"))]
    return [(path, value)] if isinstance(value, float) else []


def fits(path: tuple[str, ...], key: JsonKey) -> bool:
    """Whether a key is that of a path."""
    steps = schema._steps(key.path)
    return len(steps) == len(path) and all(step in ("{}", part)
                                           for step, part in zip(steps, path, strict=True))


def test_outlines_are_as_declared() -> None:
    row = OutlineRow("circle", 45.0, 45.0, 63.6, 45.0, None, 1.0, None, 1e-5, None, 1.0, None,
                     45.0, 1e-5, "")
    assert list(faults(OutlineTable((row,), {}).json(), RECORDS["outlines"].schema)) == []


@pytest.mark.parametrize("name", RECORDS)
def test_every_key_has_a_meaning_and_every_path_a_parent(name: str) -> None:
    keys = {key.path: key for key in RECORDS[name].keys}
    assert len(keys) == len(RECORDS[name].keys)
    for path, key in keys.items():
        assert key.meaning or path.endswith(("[]", "{}")), path
        head = path.removesuffix("[]") if path.endswith("[]") else path.rpartition(".")[0]
        assert not head or head.removesuffix("{}").removesuffix("[]") in keys, path


def test_units_are_those_of_the_names() -> None:
    units = {key.path: key.unit for record in RECORDS.values() for key in record.keys}
    assert units["deflection_m"] == "m"
    assert units["max_field_V_per_m"] == "V/m"
    assert units["misfit.noise_um"] == "µm"
    assert units["stations[].charge_C"] == "C"
    assert units["modes[].growth_per_s"] == "1/s"
    assert units["status"] == units["dofs"] == units["max_stretch"] == ""


@pytest.mark.parametrize(("change", "words"), [
    ({"deflection_m": "2 mm"}, ".deflection_m: '2 mm' is no number"),
    ({"status": "fine"}, ".status: 'fine' is none of"),
    ({"dofs": 1.5}, ".dofs: 1.5 is no integer"),
    ({"mass_kg": True}, ".mass_kg: True is no number"),
    ({"colour": "red"}, ".colour is not declared"),
    ({"limit": {"kind": "tension"}}, ".limit.voltage_V is missing"),
    ({"warnings": [1]}, ".warnings[0]: 1 is no string"),
])
def test_what_is_wrong_would_be_noticed(change: dict[str, Any], words: str, folder: Path,
                                        monkeypatch: pytest.MonkeyPatch,
                                        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(folder)
    assert main(["solve", "oval.toml", *LOADS, *COARSE, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    said = list(faults(printed | change, RECORDS["solve"].schema))
    assert said
    assert said[0].startswith(words)


def test_the_file_of_schemas_is_current() -> None:
    file = Path(__file__).parents[2] / "docs" / "schemas.json"
    assert file.read_text(encoding="utf-8") == schema.schemas(), \
        "run python -m tympan.reports.schema > docs/schemas.json"
