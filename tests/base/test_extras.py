"""What needs an optional package names its extra where that is missing; the rest goes without."""

from __future__ import annotations

import re
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from tests.support.datasets import write_dataset
from tests.support.lumped import MODELS
from tests.support.specimens import PATCH_TOML, specimen_toml
from tympan.base.extras import EXTRAS, MissingPackage, installed, needs, version_of
from tympan.cli import main
from tympan.fem.linear_solver import direct
from tympan.studies.lumped.linear import linearise

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: Commands that need the package of an extra, and what their messages begin with.
ASKING = [
    ("cad", "export oval.toml -o parts", "writing parts"),
    ("cad", "solve patch.toml --mass 10g", "a mesh cut along an electrode's outline"),
    ("cad", "draw drawn.toml -o drawn", "reading STEP"),
    ("cluster", "sweep SWEEP.toml -o swept --scheduler tcp://127.0.0.1:9", "a sweep on several"),
    ("completion", "--print-completion bash", "--print-completion"),
    ("explore", "explore oval.toml --no-browser", "the explorer"),
    ("sheets", "data readings", "reading a workbook"),
]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a file for each of the commands, and no stored meshes."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TYMPAN_CACHE", "")
    for name, text in (
            ("oval.toml", specimen_toml()), ("patch.toml", PATCH_TOML),
            ("drawn.toml", specimen_toml("drawn", 'shape = "step"\nfile = "frame.step"')),
            ("SWEEP.toml", 'specimen = "oval.toml"\nmass = "17.9 g"\nvoltage = "1 kV"\n'
                           '[grid]\n"plate.radius" = ["1 cm"]'),
            ("frame.step", "ISO-10303-21;\n")):
        (tmp_path / name).write_text(text, encoding="utf-8")
    (write_dataset(tmp_path / "readings") / "static.xlsx").write_bytes(b"PK")
    return tmp_path


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(("extra", "command", "purpose"), ASKING)
def test_one_line_says_what_to_install(extra: str, command: str, purpose: str,
                                       monkeypatch: pytest.MonkeyPatch,
                                       capsys: pytest.CaptureFixture[str]) -> None:
    package = EXTRAS[extra].package
    monkeypatch.setitem(sys.modules, package, None)
    assert main(command.split()) == 2
    out, err = capsys.readouterr()
    advice = re.escape(f"needs {package}: pip install 'tympan[{extra}]'")
    assert re.fullmatch(f"tympan: .*{re.escape(purpose)}.* {advice}\n", err), err
    assert out == ""


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("command", ["solve oval.toml --mass 17.9g --refine 0.5",
                                     "export oval.toml -o parts --inp --mass 17.9g"])
def test_ordinary_films_need_none(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for extra in EXTRAS.values():
        monkeypatch.setitem(sys.modules, extra.package, None)
    monkeypatch.setitem(sys.modules, "OCP", None)
    assert main(command.split()) == 0


def test_a_model_for_python_control_needs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(MissingPackage, match=r"control: pip install 'tympan\[control\]'"):
        linearise(MODELS["paper"], 0.0).to_control()


@pytest.mark.parametrize("there", [False, True])
def test_pardiso_is_taken_where_it_is(there: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(direct, "installed", {"pypardiso": there}.__getitem__)
    monkeypatch.setattr(direct, "PARDISO_PAYS", 0)
    monkeypatch.setattr(direct, "Pardiso", lambda *_: "Pardiso")
    assert (direct.analyse(np.zeros(0), np.zeros(1)) == "Pardiso") == there


def test_extras_are_those_of_the_project() -> None:
    declared = PROJECT["optional-dependencies"]
    for name, extra in EXTRAS.items():
        requirement, = declared[name]
        assert re.match(r"[\w-]+", requirement)[0] == extra.package
    assert declared["all"] == [f"tympan[{','.join(EXTRAS)}]"]
    assert declared["excel"] == ["tympan[sheets]"]  # its former name


def test_what_is_installed_is_found() -> None:
    assert installed("pytest")
    assert not installed("nothing_of_this_name")
    assert version_of("pytest") == version("pytest")
    assert version_of("nothing-of-this-name") is None
    for extra in EXTRAS.values():
        if installed(extra.package):
            needs(extra.package, "a test")
