"""Packages of users' own, as an installer would leave them, and commands run beside them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def installed(folder: Path, package: str, points: dict[str, dict[str, str]]) -> Path:
    """What an installer leaves of a package in a folder, but for its modules."""
    info = folder / f"{package.replace('-', '_')}-0.1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 0.1.0\n")
    (info / "entry_points.txt").write_text("".join(
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in values.items())
        for group, values in points.items()))
    return folder


def run(*words: str, path: tuple[Path, ...], cache: str) -> subprocess.CompletedProcess[str]:
    paths = [*map(str, path), os.environ.get("PYTHONPATH", ""), str(ROOT)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths)),
                                "TYMPAN_CACHE": cache}
    return subprocess.run([sys.executable, "-m", "tympan", *words], env=environment, check=False,
                          capture_output=True, text=True)
