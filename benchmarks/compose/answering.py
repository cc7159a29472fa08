"""Answer command lines, each in a process forked from one that has everything imported.

It imports the standard library and tympan alone, so that a process of another version can run this
file: it reads lines of JSON, a command line and a folder each, and prints the status and the
processor seconds of each.
"""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import resource
import sys
import traceback
from pathlib import Path

#: Processor seconds after which a question counts as failed.
MOST_SECONDS = 150
#: A process that was ended from outside has no status of its own.
_RAISED = 99
#: Files of a question's folder.
OUTPUT, ERRORS = "out.json", "err.txt"


def preload() -> None:
    """Import what questions import, so that no process of one does."""
    for name in ("base", "tables", "geometry", "fem", "studies", "commands"):
        try:
            package = importlib.import_module(f"tympan.{name}")
        except ImportError:  # a version without this package
            continue
        for module in pkgutil.walk_packages(package.__path__, f"tympan.{name}."):
            importlib.import_module(module.name)
    importlib.import_module("tympan.door")


def forked(line: list[str], folder: Path) -> tuple[int, float]:
    """Run a command in a process and a folder of its own: its status and processor seconds."""
    folder.mkdir(parents=True, exist_ok=True)
    process = os.fork()
    if not process:
        _answer(line, folder)
    _, ended, used = os.wait4(process, 0)
    return os.waitstatus_to_exitcode(ended), used.ru_utime + used.ru_stime


def _answer(line: list[str], folder: Path) -> None:
    """Run a command, and leave this process."""
    status = _RAISED
    try:
        os.chdir(folder)
        resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS + 10))
        for number, name in ((1, OUTPUT), (2, ERRORS)):
            os.dup2(os.open(name, os.O_CREAT | os.O_WRONLY | os.O_TRUNC), number)
        sys.stdout, sys.stderr = (os.fdopen(number, "w", encoding="utf-8", closefd=False)
                                  for number in (1, 2))
        from tympan.cli import main

        status = main(line)
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 1
    except BaseException:  # whatever a command raises is what is looked for
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def main() -> None:
    """Answer the command lines on standard input."""
    preload()
    for asked in sys.stdin:
        line, folder = json.loads(asked)
        print(json.dumps(forked(line, Path(folder))), flush=True)


if __name__ == "__main__":
    main()
