"""What commands print is what the reference says of it: keys, kinds, units."""

from __future__ import annotations

import argparse
import contextlib
import io
import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pytest

from tests.support.checks.json_schema import faults, printed_record
from tests.support.datasets import write_dataset
from tests.support.specimens import specimen_toml
from tympan.base.errors import InputError
from tympan.base.fields import IN_UNIT, MAY_MISS, Key, Printed
from tympan.cli import main
from tympan.commands import COMMANDS, doctor
from tympan.options import Command
from tympan.reports import schema
from tympan.reports.schema import JsonKey, json_records
from tympan.studies.alpha.table import OutlineRow, OutlineTable
from tympan.studies.files import from_json, to_json
from tympan.studies.limits.loads import LoadGrid

RECORDS = {record.name: record for record in json_records()}
LOADS = ("--mass", "17.9 g", "--voltage", "2 kV")
COARSE = ("--refine", "0.5")
BRANCH = '[[membrane.branch]]\nmodulus = "31.2 kPa"\ntime = "6.5 s"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with specimens, one with a viscous branch, plans, readings, and lumped models."""
    place = tmp_path_factory.mktemp("schema")
    (place / "REQUIREMENTS.toml").write_text(
        'specimen = "oval.toml"\nmass = "17.9 g"\nvoltage = "2 kV"\n'
        '[want]\nstroke = "largest"\n[vary]\n"plate.radius" = ["9 mm", "11 mm"]',
        encoding="utf-8")
    stretches = enumerate((1.2, 1.4, 1.6, 1.9, 2.1, 2.5, 2.8, 3.1))
    tests = [f"uniaxial,{x},{20 * (x - x**-2) + 0.1 * number % 0.3}" for number, x in stretches]
    write_lines(place / "coupon.csv", "mode,stretch,nominal_stress_kPa", tests)
    relaxing = [f"uniaxial,{1.5 + 0.25 * run},{(1 + np.exp(-time)) * (10 + run)},{run},{time}"
                for run in (1, 2, 3) for time in (0.0, 0.5, 1.0, 2.0, 5.0, 10.0)]
    write_lines(place / "relaxed.csv", "mode,stretch,nominal_stress_kPa,run,t_s", relaxing)
    rests = [f"{name},{mass},{kilovolts},{0.12 * mass + 0.02 * kilovolts**2}"
             for name in "AB" for mass in (15, 20) for kilovolts in (0, 1, 2, 3, 4)]
    rests.append("A,15,0,1.82")
    write_lines(write_dataset(place / "readings") / "static.csv",
                "specimen,mass_g,voltage_kV,displacement_mm", rests)
    (place / "oval.toml").write_text(specimen_toml(), encoding="utf-8")
    (place / "creep.toml").write_text(specimen_toml("creep") + BRANCH, encoding="utf-8")
    (place / "SWEEP.toml").write_text('specimen = "oval.toml"\nmass = "17.9 g"\nvoltage = "1 kV"\n'
                                      '[grid]\n"plate.radius" = ["1 cm"]', encoding="utf-8")
    return place


def write_lines(file: Path, head: str, rows: list[str]) -> None:
    file.write_text("\n".join([head, *rows, ""]), encoding="utf-8")


@pytest.fixture(scope="module")
def models(folder: Path) -> Path:
    """The folder with lumped models of both specimens, too."""
    built = ["lumped", "build", str(folder / "oval.toml"), str(folder / "creep.toml"), "-o",
             str(folder / "models"), "--mass", "17.9 g", "--voltage", "0 kV..3 kV", "--count", "3"]
    assert main([*built, *COARSE]) == 0
    return folder


#: Commands that mesh, and the record each prints; a few of states that do not exist, too.
MESHED = [
    ("solve", "solve oval.toml", LOADS),
    ("solve", "solve oval.toml", ("--mass", "17.9 g", "--voltage", "40 kV")),
    ("limits", "limits oval.toml", ("--mass", "17.9 g")),
    ("curve", "curve oval.toml", ("--mass", "17.9 g", "--voltage", "1 kV")),
    ("tolerance", "tolerance oval.toml",
     ("--mass", "17.9 g", "--voltage", "2 kV", "--films", "100")),
    ("sense", "sense oval.toml", ("--mass", "20 g", "--voltage", "0 kV, 3 kV", "--points", "7")),
    ("force", "force oval.toml", ("--to", "6 mm", "--voltage", "0 kV, 3 kV", "--mass", "20 g")),
    ("force", "force creep.toml", ("--to", "2 mm", "--rate", "2 mm/s")),
    ("path", "path oval.toml", LOADS),
    ("modes", "modes oval.toml", LOADS),
    ("modes", "modes oval.toml", ("--mass", "17.9 g", "--voltage", "40 kV")),
    ("sensitivity", "sensitivity oval.toml", LOADS),
    ("alpha", "alpha oval.toml", ()),
    ("response", "response creep.toml", (*LOADS, "--frequency", "1 Hz")),
    ("transient", "transient creep.toml", ("--mass", "17.9 g", "--signal", "step", "--high",
                                           "3 kV", "--duration", "1 s")),
    ("transient", "path creep.toml", ("--mass", "17.9 g", "--rate", "2 kV/s", "--turn", "2 kV")),
    ("sweep", "sweep SWEEP.toml", ("-o", "swept", "--workers", "1")),
    ("design", "design REQUIREMENTS.toml", ("-o", "designed")),
    ("lumped_build", "lumped build oval.toml creep.toml", ("--count", "2")),
]
SINE = ("--mass", "17.9 g", "--signal", "sine", "--high", "3 kV", "--duration", "1 s")
#: Those that do not.
PLAIN = [
    ("materials", "materials", ()),
    ("material_show", "material show vhb-4910", ()),
    ("material_show", "material show oval.toml", ("--held", "2")),
    ("material_fit", "material fit coupon.csv", ()),
    ("material_fit", "material fit relaxed.csv", ("--law", "neo_hooke", "--branches", "1")),
    ("effects", "effects", ()),
    ("data", "data readings", ()),
    ("doctor", "doctor", ()),
    ("lumped_simulate", "lumped simulate --model models/oval.lumped.toml", SINE),
    ("lumped_simulate", "lumped simulate --model models/creep.lumped.toml", SINE),
    ("lumped_linearise", "lumped linearise --model models/oval.lumped.toml", ()),
    ("lumped_linearise", "lumped linearise --model models/creep.lumped.toml",
     ("--voltage", "0 kV", "--input", "U2")),
    ("lumped_control", "lumped control --model models/oval.lumped.toml",
     ("--mass", "17.9 g", "--high", "2 kV", "--supply", "3 kV", "--duration", "1 s")),
    ("lumped_identify", "lumped identify readings", ("--paper", "--law", "film", "--nelder-mead")),
]
PRINTED = [*((name, command, (*options, *COARSE)) for name, command, options in MESHED), *PLAIN]


@pytest.fixture(scope="module")
def _probed_once() -> Iterator[None]:
    """What the doctor finds is the same for whoever reads it: it is looked for once."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("self_check", "python_threads", "drawing_window"):
            patch.setattr(doctor, name, cache(getattr(doctor, name)))
        yield


@pytest.mark.usefixtures("_probed_once")
@pytest.mark.parametrize(("name", "command", "options"), PRINTED)
def test_real_output_is_as_declared(name: str, command: str, options: tuple[str, ...],
                                    models: Path, monkeypatch: pytest.MonkeyPatch,
                                    capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(models)
    capsys.readouterr()
    main([*command.split(), *options, "--json"])
    printed = capsys.readouterr().out
    assert list(faults(json.loads(printed), RECORDS[name].schema)) == []
    for path in paths_of_numbers(printed_record(printed)):
        assert any(fits(path, key) for key in RECORDS[name].keys) or path[1:2] == ("material",)


@pytest.mark.usefixtures("_probed_once")
@pytest.mark.parametrize(("command", "options"), [case[1:] for case in PLAIN])
def test_what_is_printed_for_people_needs_no_key_that_is_not_there(
        command: str, options: tuple[str, ...], models: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(models)
    capsys.readouterr()
    main([*command.split(), *options])
    assert capsys.readouterr().out.strip()


def paths_of_numbers(value: Any, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """The steps to every number of a record; a law's constants, which differ, go by "material"."""
    if isinstance(value, dict):
        return [steps for name, entry in value.items()
                for steps in paths_of_numbers(entry, (*path, name))]
    if isinstance(value, list):
        return [steps for entry in value for steps in paths_of_numbers(entry, (*path, "[]"))]
    return [path] if isinstance(value, float) else []


def fits(path: tuple[str, ...], key: JsonKey) -> bool:
    """Whether a key is that of a path."""
    steps = schema._steps(key.path)
    return len(steps) == len(path) and all(step in ("{}", part)
                                           for step, part in zip(steps, path, strict=True))


def test_outlines_are_as_declared() -> None:
    row = OutlineRow("circle", 45.0, 45.0, 63.6, 45.0, None, 1.0, None, 1e-5, None, 1.0, None,
                     45.0, 1e-5, "")
    assert list(faults(OutlineTable((row,), {}).json(), RECORDS["outlines"].schema)) == []


def test_every_command_that_prints_json_has_a_record() -> None:
    described = {name for record in RECORDS.values() for name in record.commands.split(", ")}
    printing = {f"tympan {command.name}" for command in COMMANDS if "--json" in usage_of(command)}
    assert len(printing) > 20
    assert not printing - described


def usage_of(command: Command) -> str:
    parser = argparse.ArgumentParser()
    for add in command.arguments:
        add(parser)
    return parser.format_usage()


@pytest.mark.parametrize("name", RECORDS)
def test_every_key_has_a_meaning_and_every_path_a_parent(name: str) -> None:
    keys = {key.path: key for key in RECORDS[name].keys}
    assert len(keys) == len(RECORDS[name].keys)
    for path, key in keys.items():
        assert key.meaning or path.endswith(("[]", "{}")), path
        head = path.removesuffix("[]") if path.endswith("[]") else path.rpartition(".")[0]
        assert not head or head in keys or head.removesuffix("{}").removesuffix("[]") in keys, path


@dataclass(frozen=True)
class Told:
    noise: Annotated[float, Key("noise"), IN_UNIT]
    others: Annotated[tuple[str, ...], Key("others"), Printed("with")]
    limit: Annotated[float | None, Key("limit"), MAY_MISS] = None


@pytest.mark.parametrize(("value", "unit", "written"), [
    (Told(2.0, ("a",)), "kPa", {"noise_kPa": 2.0, "with": ["a"]}),
    (Told(2.0, (), np.nan), "um", {"noise_um": 2.0, "with": [], "limit": None}),
    (LoadGrid((0.01,), (0.0, 1e3)), "", {"masses": [0.01], "voltages": [0.0, 1000.0]}),
], ids=["missing", "none", "the keys of its input files are others"])
def test_keys_are_as_declared_and_read_back(value: Any, unit: str, written: dict[str, Any]) -> None:
    assert to_json(value, unit) == written
    assert to_json(from_json(type(value), written, unit=unit), unit) == written


def test_units_are_those_of_the_names() -> None:
    units = {key.path: key.unit for record in RECORDS.values() for key in record.keys}
    assert units["deflection_m"] == "m"
    assert units["max_field_V_per_m"] == "V/m"
    assert units["misfit.noise_um"] == "µm"
    assert units["stations[].charge_C"] == "C"
    assert units["modes[].growth_per_s"] == "1/s"
    assert units["status"] == units["dofs"] == units["max_stretch"] == ""


@pytest.fixture(scope="module")
def solved(folder: Path) -> dict[str, Any]:
    """What is printed of a film."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        assert main(["solve", str(folder / "oval.toml"), *LOADS, *COARSE, "--json"]) == 0
    record: dict[str, Any] = json.loads(printed.getvalue())
    return record


@pytest.mark.parametrize(("change", "words"), [
    ({"deflection_m": "2 mm"}, ".deflection_m: '2 mm' is no number"),
    ({"status": "fine"}, ".status: 'fine' is none of"),
    ({"dofs": 1.5}, ".dofs: 1.5 is no integer"),
    ({"mass_kg": True}, ".mass_kg: True is no number"),
    ({"colour": "red"}, ".colour is not declared"),
    ({"limit": {"kind": "tension"}}, ".limit.voltage_V is missing"),
    ({"schema": 2}, ".schema: 2 is not 1"),
    ({"warnings": [1]}, ".warnings[0]: 1 is no string"),
])
def test_what_is_wrong_would_be_noticed(change: dict[str, Any], words: str,
                                        solved: dict[str, Any]) -> None:
    said = list(faults(solved | change, RECORDS["solve"].schema))
    assert said
    assert said[0].startswith(words)


def test_a_stored_word_that_is_none_of_those_allowed_is_refused() -> None:
    words = r"^a\.json: verdict: given 'sure': must be one of yes, no"
    with pytest.raises(InputError, match=words):
        from_json(Literal["yes", "no"], "sure", "a.json", "verdict")
    assert from_json(Literal["yes", "no"], "no") == "no"


def test_schemas_and_their_page_are_current() -> None:
    docs = Path(__file__).parents[2] / "docs"
    assert (docs / "schemas.json").read_text(encoding="utf-8") == schema.schemas(), \
        "run python -m tympan.reports.schema > docs/schemas.json"
    assert (docs / "json.md").read_text(encoding="utf-8") == schema.json_page(), \
        "run python -m tympan.reports.schema --page > docs/json.md"
