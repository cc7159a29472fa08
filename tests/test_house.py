"""The house rules that a program can check: style, types, and who imports whom."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.mark.parametrize(
    "command",
    [
        ["-m", "ruff", "check", "--no-cache", "."],
        ["-m", "mypy", f"--cache-dir={os.devnull}"],
        ["-c", "from importlinter.cli import lint_imports_command; lint_imports_command()",
         "--no-cache"],
    ],
    ids=["ruff", "mypy", "import-linter"],
)
def test_checker_is_content(command: list[str]) -> None:
    done = subprocess.run([sys.executable, *command], cwd=ROOT, capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_import_rule_would_catch_a_breach(tmp_path: Path) -> None:
    """The contracts are not empty: a fem module that imports the mesher is reported."""
    for package in ("geometry", "fem", "studies", "reports", "tympan"):
        shutil.copytree(ROOT / package, tmp_path / package,
                        ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text(encoding="utf-8"),
                                             encoding="utf-8")
    with (tmp_path / "fem" / "density.py").open("a") as file:
        file.write("\nimport tympan.geometry.mesher\n")
    code = ("import sys; sys.path.insert(0, '.'); from importlinter.cli import lint_imports_command; "
            "lint_imports_command()")
    done = subprocess.run([sys.executable, "-c", code, "--no-cache"], cwd=tmp_path,
                          capture_output=True, text=True,
                          check=False)
    assert done.returncode == 1
    assert "fem knows no CAD, gmsh or drawing BROKEN" in done.stdout
