"""Folders of results: a user's own files, lists that are none, signals, what a kill left."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from benchmarks.trials.hostile.case import PATIENCE, Case, Cases, group
from benchmarks.trials.hostile.inputs import GOOD, LOADS, SAMPLE

#: A quick command, and one that another process already works for in the same folder.
DRAW = "draw specimen.toml -o m"
HELD = """
import sys
from pathlib import Path
from tympan.cli import main
from tympan.base.process.folder import alone
with alone(Path("m")):
    sys.exit(main(sys.argv[1:]))
"""
#: A signal to the command itself, within a callback of scipy that swallows what is raised, and
#: within a function of ours that swallows it.
SWALLOWED = """
import os, signal, sys, time
from tympan import __main__, cli
from tympan.studies.sweep import plan

def drawn(*arguments):
    try:
        os.kill(os.getpid(), signal.{name})
        time.sleep(10)  # on a busy machine a signal comes a little later
    except BaseException:
        pass
    return [[0.5, 0.5]] * arguments[1]

plan.drawn_points = drawn
sys.argv[0] = "tympan"
__main__.run_command()
"""
SOBOL = (f'{LOADS}{SAMPLE}"plate.radius" = ["8 mm", "15 mm"]\n'
         '"frame.semi_axes.0" = ["5 cm", "6 cm"]')


def _unchanged(name: str, content: str) -> Callable[[Path], str]:
    def check(folder: Path) -> str:
        return "" if (folder / name).read_text() == content else f"{name} changed"

    return check


@group("a user's file")
def users_file() -> Cases:
    mine = "mine\n"
    for kind, listed in (("never written", ""), ("replaced", f"{'0' * 64}  oval-specimen.png\n"),
                         ("of an earlier version", "oval-specimen.png\n")):
        yield Case(f"picture {kind}", DRAW, {
            **GOOD, "m/oval-specimen.png": mine, **({"m/.tympan": listed} if listed else {})},
            "oval-specimen.png: (is there already|was changed|is from an earlier)",
            check=_unchanged("m/oval-specimen.png", mine), seconds=PATIENCE)  # it is drawn first
    yield Case("folder in use", DRAW, GOOD, "m: is in use by another command", program=("-c", HELD),
               check=lambda folder: "a folder" if (folder / "m").exists() else "")


def _as_link(folder: Path) -> None:
    (folder / "m" / ".tympan").symlink_to(folder / "target")


def _left_half(folder: Path) -> None:
    (folder / "m" / "fields").mkdir(parents=True)
    for name in ("m/.tympan-abc.png", "m/fields/.tympan-abc.vtu"):
        (folder / name).write_text("half")


def _no_halves(folder: Path) -> str:
    halves = [file.name for file in folder.rglob(".tympan-*")]
    return f"{len(halves)} temporary files" if halves else ""


@group("list of results")
def list_of_results() -> Cases:
    words = r"m/\.tympan: is not the list"
    target: dict[str, str | bytes | None] = {**GOOD, "target": "mine\n", "m/a.txt": ""}
    yield Case("binary", DRAW, {**GOOD, "m/.tympan": bytes(range(256))}, words)
    yield Case("pipe", DRAW, {**GOOD, "m/.tympan": None}, words)
    yield Case("link", DRAW, target, words, prepare=_as_link, check=_unchanged("target", "mine\n"))
    yield Case("link to /dev/zero", DRAW, {**GOOD, "m/a.txt": ""}, words, prepare=lambda folder:
               (folder / "m" / ".tympan").symlink_to("/dev/zero"))
    yield Case("folder", DRAW, GOOD, words,
               prepare=lambda folder: (folder / "m" / ".tympan").mkdir(parents=True))
    yield Case("cut off", DRAW, {**GOOD, "m/.tympan": "0123"}, status=0)
    yield Case("what a kill left", DRAW, GOOD, status=0, prepare=_left_half, check=_no_halves)


@group("swallowed signal")
def swallowed_signal() -> Cases:
    for name, status, words in (("SIGINT", 130, "interrupted"), ("SIGTERM", 143, "terminated")):
        yield Case(name, "sweep SWEEP.toml -o out", {**GOOD, "SWEEP.toml": SOBOL},
                   f"^tympan: {words}", status, never="Traceback|ignored",
                   program=("-c", SWALLOWED.format(name=name)),
                   check=lambda folder: "results" if list(folder.glob("out/sweep*")) else "")
