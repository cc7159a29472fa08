"""The house rules that a program can check: style, types, who imports whom."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PRODUCT = ("base", "tables", "geometry", "fem", "studies", "reports", "tympan")
LINT = "from importlinter.cli import lint_imports_command; lint_imports_command()"

#: A wrong import for every contract: where it is written, what is written, and what is then said.
BREACHES = {
    "base, tables, geometry, fem, studies, reports, explorer, commands: never back":
        ("base/units.py", "import tympan.studies.files",
         "tympan.base.units -> tympan.studies.files"),
    "fem's floors":
        ("fem/film/breakdown.py", "import tympan.fem.membrane.model",
         "tympan.fem.film.breakdown -> tympan.fem.membrane.model"),
    "the studies' floors":
        ("studies/case.py", "import tympan.studies.modes",
         "tympan.studies.case -> tympan.studies.modes"),
    "no circle between folders or files":
        ("base/errors.py", "import tympan.base.units", "tympan.base."),
    "inference knows no film":
        ("studies/diagnosis/fits/fit.py", "import tympan.studies.diagnosis.reduced.axes",
         "tympan.studies.diagnosis.fits.fit -> tympan.studies.diagnosis.reduced.axes"),
    "fem knows no CAD, gmsh or drawing":
        ("fem/film/density.py", "import tympan.geometry.mesher",
         "tympan.fem.film.density -> tympan.geometry.mesher"),
    "only the mesher touches gmsh":
        ("studies/files.py", "import gmsh", "tympan.studies.files -> gmsh"),
}


@cache
def parsed(file: Path) -> ast.Module:
    """A module, parsed once for all tests, which change none."""
    return ast.parse(file.read_text(encoding="utf-8"))


def files_of(*folders: str) -> Iterator[tuple[Path, ast.Module]]:
    """The modules of folders, parsed, each with its path from the root; links are not followed."""
    for folder in folders:
        for file in sorted((ROOT / folder).rglob("*.py")):
            yield file.relative_to(ROOT), parsed(file)


def imports(tree: ast.Module) -> Iterator[str]:
    """What a module imports anywhere, a name imported from a package as if it were a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def is_test(module: str) -> bool:
    """Whether it is a test module, or something in one."""
    return any(part.startswith("test_") or part == "conftest" for part in module.split("."))


@pytest.mark.parametrize(
    "command",
    [
        ["-m", "ruff", "check", "."],
        ["-m", "mypy"],
        ["-c", LINT],
    ],
    ids=["ruff", "mypy", "import-linter"],
)
def test_checker_is_content(command: list[str]) -> None:
    """Files are checked again where they, or what they import, have changed since the last check.
    """
    done = subprocess.run([sys.executable, *command], cwd=ROOT, capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_contract_would_catch_a_breach(tmp_path: Path) -> None:
    for folder in PRODUCT:
        shutil.copytree(ROOT / folder, tmp_path / folder, symlinks=True,
                        ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for file, line, _ in BREACHES.values():
        with (tmp_path / file).open("a", encoding="utf-8") as source:
            source.write(f"\n{line}\n")
    done = subprocess.run([sys.executable, "-c", f"import sys; sys.path.insert(0, '.'); {LINT}",
                           "--no-cache"],
                          cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    kept = [line for line in done.stdout.splitlines() if " KEPT" in line]
    assert not kept
    _, _, broken = done.stdout.partition("Broken contracts")
    for contract, (_, _, said) in BREACHES.items():
        # Each contract's complaints stand under its name, underlined.
        _, _, complaints = broken.partition(f"{contract}\n{'-' * len(contract)}")
        assert said in complaints.split("\n---")[0], contract


def test_no_test_is_imported() -> None:
    """Tests import no tests, benchmarks nothing of tests/ but the oracles, oracles no benchmark."""
    allowed = {"tests": ("tests.", "benchmarks.compose", "benchmarks.explore.",
                         "benchmarks.external", "benchmarks.first_limit",
                         "benchmarks.peers.harness", "benchmarks.release.", "benchmarks.trials.",
                         "benchmarks.verification"),
               "benchmarks": ("tests.oracles.", "benchmarks."),
               "tests/oracles": ("tests.oracles.",),
               "tests/support": ("tests.oracles.", "tests.support.")}
    wrong = [f"{file}: {module}"
             for folder, prefixes in allowed.items()
             for file, tree in files_of(folder)
             for module in imports(tree)
             if module.split(".")[0] in ("tests", "benchmarks", "conftest")
             and (is_test(module) or not module.startswith(prefixes))]
    assert not wrong


def test_a_constant_has_a_line_of_its_own() -> None:
    """So that its reason can stand above it."""
    assert not [f"{file}:{node.lineno}" for file, tree in files_of(*PRODUCT)
                for node in tree.body if isinstance(node, ast.Assign)
                and any(isinstance(target, ast.Tuple) for target in node.targets)]


#: Versions and examples of the program's own, which hold nothing that a user named.
NO_COMMANDS = {"tympan/cli.py", "tympan/options.py", "studies/sweep/task.py"}


def offered_commands(tree: ast.Module) -> Iterator[int]:
    """Lines where a command of tympan is put together with values, within a text."""
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            text = "".join(str(part.value) if isinstance(part, ast.Constant) else "\0"
                           for part in node.values)
            if re.search(r"\btympan [a-z -]*\0", text):
                yield node.lineno


def test_offered_commands_are_quoted_in_one_place() -> None:
    """So that a file's name, pasted into a shell, runs nothing: ``command_line`` makes them."""
    for text in ('f"run `tympan solve {file}`"', 'f"tympan {command}"', 'f"tympan fit --law {law}"'
                 ):
        assert list(offered_commands(ast.parse(text))) == [1], text
    assert not list(offered_commands(ast.parse('f"tympan: {error}"')))
    assert not [f"{file}:{line}" for file, tree in files_of(*PRODUCT)
                for line in offered_commands(tree) if str(file) not in NO_COMMANDS]


def test_nothing_cites_what_is_not_in_the_project() -> None:
    citing = [str(file) for folder in (*PRODUCT, "tests", "benchmarks")
              for file in (ROOT / folder).rglob("*.*")
              if file.suffix in (".py", ".html", ".toml", ".txt")
              and re.search(r"[Dd]esign §", file.read_text(encoding="utf-8"))
              and file.name != "test_house.py"]
    assert not citing


def test_files_of_tests_have_names_of_their_own() -> None:
    """Two of one name in folders without a package end the whole run while it is collected."""
    names = [file.name for file in (ROOT / "tests").rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))
