"""Count the functions and files of the program that run in a command.

    python -m benchmarks.traces solve oval.toml --mass "17.9 g" --voltage "3.5 kV"

Whoever follows the command through the code meets as many. Classes count where they are made, as
functions do; expressions without a name do not.
"""

from __future__ import annotations

import sys
import threading
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PRODUCT = ("base", "tables", "geometry", "fem", "studies", "reports", "tympan")


def trace(command: list[str]) -> dict[str, set[str]]:
    """Run a command and tell which functions ran, by the file that defines them."""
    met = set[tuple[str, str]]()

    def note(frame: FrameType, event: str, _: Any) -> None:
        if event == "call":
            met.add((frame.f_code.co_filename, frame.f_code.co_qualname))

    sys.setprofile(note)
    threading.setprofile(note)
    try:
        from tympan.cli import main

        main(command)
    except SystemExit:
        pass
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    found: dict[str, set[str]] = {}
    for name, function in met:
        file = Path(name).resolve()
        inside = file.is_relative_to(ROOT) and file.relative_to(ROOT).parts[0] in PRODUCT
        if inside and not function.rpartition(".")[2].startswith("<"):
            found.setdefault(str(file.relative_to(ROOT)), set()).add(function)
    return found


def main() -> None:
    """Print how many functions ran in each package, and in all."""
    found = trace(sys.argv[1:])
    functions, files = Counter[str](), Counter[str]()
    for file, names in found.items():
        package = file.partition("/")[0]
        functions[package] += len(names)
        files[package] += 1
    for package in PRODUCT:
        print(f"{package:10s} {functions[package]:5d} functions in {files[package]:3d} files",
              file=sys.stderr)
    print(f"{'all':10s} {functions.total():5d} functions in {files.total():3d} files",
          file=sys.stderr)


if __name__ == "__main__":
    main()
