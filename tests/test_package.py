"""What is installed: ``tympan`` alone, with its data, and undisturbed by a user's own modules."""

from __future__ import annotations

import fcntl
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from email import message_from_string
from pathlib import Path

import pytest

from benchmarks.release import BUILD, PYTHONS, SOURCES, TRIALS, copied, files_in
from tympan.base.extras import EXTRAS

ROOT = Path(__file__).parent.parent
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
#: Names of a user's own files that were import names of the project once, or are names of others.
USERS = ("base", "tables", "geometry", "fem", "studies", "reports", "tests", "units", "specimen")

#: Run with a name of the lock in each line of its input: it imports every module of tympan without
#: other packages, at first also without those of its arguments; it prints the modules that need
#: these.
IMPORT_ALL = """
import importlib, pkgutil, re, sys
from importlib.machinery import PathFinder
from importlib.metadata import packages_distributions
import tympan
def plain(name): return re.sub("[-_.]+", "-", name).lower()
allowed = {plain(name) for name in sys.stdin.read().split()} | {"tympan"}
refused = {package for package, distributions in packages_distributions().items()
           if not allowed & set(map(plain, distributions))} - sys.modules.keys()
refused |= set(sys.argv[1:])
class Installed(PathFinder):
    @classmethod
    def find_spec(cls, name, *rest):
        return None if name.split(".")[0] in refused else super().find_spec(name, *rest)
sys.meta_path[sys.meta_path.index(PathFinder)] = Installed
needing = []
for module in pkgutil.walk_packages(tympan.__path__, "tympan."):
    if not module.name.endswith("__main__"):
        try:
            importlib.import_module(module.name)
        except ModuleNotFoundError as error:
            if error.name.split(".")[0] not in sys.argv[1:]:
                raise
            needing.append(module.name)
refused -= set(sys.argv[1:])
for module in needing:
    importlib.import_module(module)
    print(module)
"""


def _pins(lock: str) -> dict[str, str]:
    """Versions in a lock, with their conditions, by name."""
    lines = (ROOT / lock).read_text(encoding="utf-8").splitlines()
    return dict(line.split("==", 1) for line in lines if "==" in line and line[0].isalnum())


def test_a_user_s_lock_is_part_of_the_developers() -> None:
    user, developer = _pins("requirements.lock"), _pins("requirements-dev.lock")
    assert user.items() < developer.items()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    left_out = {line.split(";")[0] for line in project["tool"]["uv"]["override-dependencies"]}
    assert not left_out & developer.keys()
    extras = project["project"]["optional-dependencies"]
    named = {re.split("[>=]", line)[0] for line in (
        *extras["dev"], *extras["docs"], *extras["cad"], *project["project"]["dependencies"])}
    assert named <= developer.keys()
    assert {EXTRAS[name].package for name in ("cad", "completion", "explore", "sheets")
            } <= user.keys()


def test_what_a_user_s_lock_installs_is_enough() -> None:
    """What is optional is imported where it is used, and named there if it is missing."""
    optional = ["OCP", *(extra.package for extra in EXTRAS.values())]
    done = subprocess.run([sys.executable, "-c", IMPORT_ALL, *optional], cwd=ROOT, text=True,
                          input="\n".join(_pins("requirements.lock")), capture_output=True,
                          check=False)
    assert done.returncode == 0, done.stderr
    assert set(done.stdout.split()) == {
        "tympan.explore.door", "tympan.explore.server", "tympan.explore.talk",
        "tympan.geometry.cad.membrane", "tympan.geometry.cad.parts", "tympan.geometry.cad.wires",
        "tympan.geometry.outlines.step"}


def _python(*arguments: str, cwd: Path, path: Path | None = None
            ) -> subprocess.CompletedProcess[str]:
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    if path is not None:
        environment["PYTHONPATH"] = str(path)
    return subprocess.run([sys.executable, *arguments], cwd=cwd, env=environment, text=True,
                          capture_output=True, check=False)


@pytest.fixture(scope="session")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The wheel built from the tree and the one built from its source distribution."""
    base = tmp_path_factory.getbasetemp()
    folder = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    with (folder / "wheels.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        tree = folder / "wheels"
        if not tree.exists():
            built = _python("-c", BUILD, cwd=copied(SOURCES, tree))
            assert built.returncode == 0, built.stdout + built.stderr
    straight, = (tree / "straight").glob("*.whl")
    by_source, = (tree / "by_source").glob("*.whl")
    return straight, by_source


@pytest.fixture(scope="session")
def installed(wheels: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which the wheel is unpacked, as installing does."""
    folder = tmp_path_factory.mktemp("installed")
    zipfile.ZipFile(wheels[0]).extractall(folder)
    return folder


def test_the_wheel_holds_tympan_whole_and_nothing_else(wheels: tuple[Path, Path]) -> None:
    names = files_in(wheels[0])
    straight = set(names)
    assert len(names) == len(straight)
    assert names == files_in(wheels[1])
    ours = {name for name in straight if name.startswith("tympan/")}
    assert {name.split("/")[0] for name in straight - ours} == {f"tympan-{VERSION}.dist-info"}
    sources = {str(Path(folder, name).relative_to(ROOT))
               for folder, _, names in os.walk(ROOT / "tympan", followlinks=True)
               if "__pycache__" not in folder for name in names}
    assert ours == sources
    assert {Path(name).suffix for name in ours} >= {".py", ".pyi", ".typed", ".html", ".js",
                                                    ".css", ".toml", ".csv", ".txt"}


def test_what_the_wheel_says_of_itself(wheels: tuple[Path, Path]) -> None:
    """Licence and Pythons are those of the project, and the citation has its version."""
    said, = (message_from_string(zipfile.ZipFile(wheels[0]).read(name).decode())
             for name in zipfile.ZipFile(wheels[0]).namelist() if name.endswith("/METADATA"))
    assert (said["Version"], said["License-Expression"]) == (VERSION, "BSD-3-Clause")
    assert set(said.get_all("Provides-Extra")) > {*EXTRAS, "all", "excel"}
    classified = set(said.get_all("Classifier"))
    assert classified > {"Typing :: Typed", "Intended Audience :: Science/Research",
                         "Operating System :: POSIX :: Linux"}
    pythons = {line.rpartition(" ")[2] for line in classified if "Python :: 3." in line}
    assert {f"python{python}" for python in pythons} == set(PYTHONS)
    assert said["Requires-Python"] == "<3.14,>=3.11"
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {VERSION}\n" in citation
    assert f"\nlicense: {said['License-Expression']}\n" in citation


def test_every_extra_is_tried_before_a_release() -> None:
    assert set(TRIALS) == {*EXTRAS, "all"}


def test_a_user_s_own_modules_disturb_nothing(installed: Path, tmp_path: Path) -> None:
    for name in USERS:
        (tmp_path / f"{name}.py").write_text(f"MINE = {name!r}\n")
    imports = "\n".join(f"import {name}\nassert {name}.MINE == {name!r}" for name in USERS)
    (tmp_path / "script.py").write_text(
        f"import tympan\n{imports}\n"
        "from tympan.reports.study import page\n"
        "from tympan.studies.shipped import actuators\n"
        "print(tympan.__version__, tympan.__file__, len(actuators()))\n")
    script = _python("script.py", cwd=tmp_path, path=installed)
    assert script.returncode == 0, script.stderr
    assert script.stdout.split() == [VERSION, str(installed / "tympan" / "__init__.py"), "3"]
    version = _python("-m", "tympan", "--version", cwd=tmp_path, path=installed)
    assert (version.returncode, version.stdout) == (0, f"tympan {VERSION}\n")
    materials = _python("-m", "tympan", "materials", cwd=tmp_path, path=installed)
    assert materials.returncode == 0, materials.stderr
    assert "vhb-4910" in materials.stdout


#: A user's project; the README's eight lines stand above it.
CONSUMER = """
from pathlib import Path

from typing_extensions import assert_type

import tympan
from tympan.studies.case import CaseResult

heavy: tympan.Case = tympan.Case(oval, mass=0.02, voltage="1 kV")
for result in (tympan.solve(oval, mass=heavy.mass), tympan.solve(tympan.load(Path("a.toml")))):
    assert_type(result, tympan.Result[CaseResult])
    deflection: float | None = result.numbers.deflection_m
    result.save(Path("folder"))
shape = tympan.Rotated(tympan.Stadium((0.06, "4 cm")), rotation="30 deg")
law = tympan.Ogden(["16 kPa"], [2.0])
version: str = tympan.__version__
"""
WRONG = {"tympan.Circle(b'1 cm')": "arg-type", "tympan.solve(oval, mas='1 g')": "call-arg",
         "tympan.Case(oval, 20, 3)": "call-arg", "tympan.nonsense": "attr-defined"}


def test_a_consumer_under_strict_mypy(installed: Path, tmp_path: Path) -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    lines = readme.split("```python\n")[1].split("```")[0] + CONSUMER
    (tmp_path / "right.py").write_text(lines)
    (tmp_path / "wrong.py").write_text(
        "from right import oval\nimport tympan\n" + "\n".join(WRONG))
    done = _python("-m", "mypy", "--strict", "--no-color-output", f"--cache-dir={os.devnull}",
                   "right.py", "wrong.py", cwd=tmp_path, path=installed)
    errors = [line for line in done.stdout.splitlines() if ": error: " in line]
    assert len(errors) == len(WRONG), done.stdout
    for error, (line, code) in zip(errors, WRONG.items(), strict=True):
        assert error.startswith("wrong.py:"), line
        assert error.endswith(f"[{code}]"), line
