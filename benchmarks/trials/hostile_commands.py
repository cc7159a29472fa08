"""Commands with bad input, each in a process of its own: what they say, with what status, how soon.

    python -m benchmarks.trials.hostile_commands [--only WORD]

Every kind of input that once raised, hung or ended the process. One line is asked for, naming what
is wrong, with status 2 within two seconds on the clock; where something else is right it stands
with the command. Clusters and signals need other processes beside: those are in the tests.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import chain, pairwise
from pathlib import Path

import ezdxf
from ezdxf.layouts import Modelspace

from benchmarks.trials.fuzz import BODY, COUPON, DATASET, OVAL, STATIC, TRANSIENT

VHB = 'material = "vhb-4910"\n'
SPECIMEN = OVAL + VHB
GOOD: dict[str, str | bytes | None] = {"specimen.toml": SPECIMEN}
SOLVE = "solve specimen.toml --mass '1 g'"
LOADS = 'specimen = "specimen.toml"\nmass = "17.9 g"\nvoltage = "1 kV"\n'
SAMPLE = '[sample]\nmethod = "sobol"\ncount = 8\n[sample.ranges]\n'
TESTS = COUPON + "uniaxial,2,30\nuniaxial,3,40\nequibiaxial,3,60\n"
TEN = str([f"{size} mm" for size in range(1, 11)])
CORNERS = ((0, 0), (90, 0), (90, 80), (0, 80))
#: Seconds to a message, and to an answer where the input is right.
SECONDS, PATIENCE = 2.0, 30.0


@dataclass(frozen=True)
class Command:
    """What is typed, the files it finds, words of its answer, and how it has to end.

    ``files`` maps a name to contents; None is a pipe nobody writes to.
    """

    arguments: str
    files: dict[str, str | bytes | None]
    words: str
    status: int = 2
    seconds: float | None = None
    environment: dict[str, str] = field(default_factory=dict)
    largest_file: int | None = None


@dataclass(frozen=True)
class Answer:
    """Exit status, standard error and seconds on the clock."""

    status: int
    error: str
    seconds: float

    def fault(self, command: Command) -> str:
        """In a word what is wrong with it; empty if nothing."""
        if self.status != command.status:
            return f"status {self.status}"
        if re.search(command.words, self.error) is None:
            return "other words"
        if command.status == 2 and self.error.count("\n") != 1:
            return "not one line"
        allowed = command.seconds or (SECONDS if command.status == 2 else PATIENCE)
        return "late" if self.seconds > allowed else ""


def _specimen(old: str, new: str, words: str) -> Command:
    assert old in SPECIMEN
    return Command(SOLVE, {"specimen.toml": SPECIMEN.replace(old, new, 1)},
                   f"specimen.toml: .*{words}")


def _points(*places: tuple[object, object]) -> str:
    return str([[f"{x} mm", f"{y} mm"] for x, y in places])


def _frame(frame: str, words: str, plate: str = "", status: int = 2) -> Command:
    body = BODY.replace('radius = "1 cm"\noffset = ["2 mm", "0 mm"]', plate) if plate else BODY
    return Command(SOLVE, {"specimen.toml": f'name = "film"\n[frame]\n{frame}\n{body}{VHB}'},
                   words, status)


def _dxf(draw: Callable[[Modelspace], object], change: tuple[bytes, bytes], words: str) -> Command:
    document = ezdxf.new(units=ezdxf.units.MM)
    draw(document.modelspace())
    with tempfile.TemporaryDirectory() as folder:
        document.saveas(Path(folder) / "a.dxf")
        content = (Path(folder) / "a.dxf").read_bytes()
    assert change[0] in content
    specimen = f'name = "film"\n[frame]\nshape = "dxf"\nfile = "a.dxf"\n{BODY}{VHB}'
    return Command(SOLVE, {"specimen.toml": specimen, "a.dxf": content.replace(*change, 1)}, words)


def _circle(radius: float, space: Modelspace) -> None:
    space.add_circle((0, 0), radius)


def _lines(*places: tuple[float, float]) -> Callable[[Modelspace], None]:
    def draw(space: Modelspace) -> None:
        for start, end in pairwise(places):
            space.add_line(start, end)

    return draw


def _spline(count: int, weights: tuple[float, ...] = ()) -> Callable[[Modelspace], None]:
    def draw(space: Modelspace) -> None:
        spline = space.add_open_spline([(0, 0, 0), (30, 0, 0), (30, 30, 0), (0, 0, 0)])
        spline.control_points = list(spline.control_points)[:count]
        spline.weights = weights

    return draw


def _step(old: str, new: str, words: str) -> Command:
    """A rectangle with two of its numbers swapped, or one that is none."""
    import cadquery as cq

    from tympan.geometry.cad import membrane as cad
    from tympan.geometry.cad.wires import outline_wire, planar
    from tympan.geometry.outlines import Polygon

    corners = ((55e-3, 25e-3), (-55e-3, 25e-3), (-55e-3, -25e-3), (55e-3, -25e-3))
    with tempfile.TemporaryDirectory() as folder:
        cad.write_step([cq.Face(planar(outline_wire(Polygon(corners))))], Path(folder) / "a.step")
        content = (Path(folder) / "a.step").read_text(encoding="utf-8")
    assert old in content
    specimen = f'name = "film"\n[frame]\nshape = "step"\nfile = "a.step"\n{BODY}{VHB}'
    return Command(SOLVE, {"specimen.toml": specimen, "a.step": content.replace(old, new, 1)},
                   words)


def _sweep(text: str, words: str) -> Command:
    return Command("sweep SWEEP.toml -o out", {"specimen.toml": SPECIMEN, "SWEEP.toml": text},
                   words)


def _data(command: str, words: str, **tables: str | None) -> Command:
    files = {f"data/{name}.csv": content for name, content in tables.items()}
    return Command(command, {"data/dataset.toml": DATASET, **files}, words)


def _coupon(words: str, content: str, options: str = "") -> Command:
    return Command(f"material fit coupon.csv -o out {options}", {"coupon.csv": content}, words)


def commands() -> Iterator[tuple[str, Command]]:
    """By kind of defect."""
    return chain(_files(), _shapes(), _surroundings())


def _files() -> Iterator[tuple[str, Command]]:
    """Numbers, tables and readings."""
    for value in ("1 mm**9**9**9", "9**9**9**9 mm", "1 mm.__class__"):
        yield "unit", _specimen('"1 cm"', f'"{value}"', "plate.radius.*unknown unit")
    yield "toml", _specimen("= 4.7", f"= {'1' * 5000}", "too many digits")
    yield "toml", _specimen("[plate]", f"[plate{'.plate' * 1000}]", "nested")
    for name, command in (("STUDY.toml", "study STUDY.toml"), ("SWEEP.toml", "sweep SWEEP.toml")):
        loads = LOADS.replace("specimen.toml", "a\\u0000b.toml")
        listed = re.sub("specimen = (.*)", r'name = "s"\nspecimens = [\1]', loads)
        yield "toml", Command(f"{command} -o out", {name: listed if "STUDY" in name else loads},
                              "no file has NUL in its name")
    yield "numbers", Command(f"{SOLVE} --elapsed 'inf s'", GOOD, "--elapsed")
    study = LOADS.replace("1 kV", "1e300 V").replace("specimen = ", 'name = "s"\nspecimens = [')
    yield "numbers", Command("study STUDY.toml -o out", {
        **GOOD, "STUDY.toml": study.replace('.toml"', '.toml"]', 1)}, "STUDY.toml.*voltage")
    yield "numbers", Command(f"{SOLVE} --rig rig.toml --elapsed '1 s'", {
        **GOOD, "rig.toml": 'drift = "1e300 m/s"\n'}, "rig.toml: drift")
    for count, many in ((10, TEN), (40, "[1, 2]")):
        grid = "\n".join(f'"k{key}" = {many}' for key in range(count))
        yield "cases", _sweep(f"{LOADS}[grid]\n{grid}", "grid.*at most 1000000 specimens")
    keys = "\n".join(f'"k{key}" = [1, 2]' for key in range(21_202))
    yield "cases", _sweep(LOADS + SAMPLE + keys, "at most 1000 keys")
    yield "cases", _sweep(f'{LOADS}{SAMPLE}"k" = [1, 1{"0" * 400}]', "64 bits")
    yield "no file", Command(SOLVE, {"specimen.toml": None}, "specimen.toml: cannot be read")
    yield "no file", _data("data data", "static.csv: cannot be read", static=None)
    yield "no file", Command("solve /dev/zero --mass '1 g'", {}, "cannot be read")
    massless = "\n".join(line.replace("17.9", "0") for line in STATIC.splitlines())
    yield "readings", _data("diagnose data -o out", "must be above 0", static=massless)
    for time_s in ("1e300", "1e-300"):
        lines = TRANSIENT.splitlines()
        table = "\n".join([*lines[:2], lines[2].replace("0.1", time_s, 1)])
        yield "readings", _data("lumped identify data --dynamic -o out", "transient.csv: line 3",
                                transient=table)
    yield "readings", _data("lumped identify data --dynamic -o out", "transient.csv: line 2",
                            transient=TRANSIENT.replace("2.0", "1e300"))
    yield "readings", _coupon("coupon.csv: line 2", COUPON.replace("1.5,20", "1.5,1e300"))
    yield "readings", _coupon("coupon.csv: line 2", COUPON.replace("1.5,20", "1e10,20"))


def _shapes() -> Iterator[tuple[str, Command]]:
    """Outlines and drawings."""
    outlined = SPECIMEN + '[electrode.outline]\nshape = "circle"\nradius = "3 cm"\n'
    yield "room", Command(SOLVE, {"specimen.toml": outlined}, "temporary files", largest_file=1000)
    twice, closed = (*CORNERS[:2], *CORNERS[1:]), (*CORNERS, CORNERS[0])
    for shape in ('"polygon"\nvertices = ', '"spline"\nthrough = '):
        yield "outlines", _frame(f"shape = {shape}{_points(*twice)}", "is there twice")
        yield "outlines", _frame(f"shape = {shape}{_points(*closed)}", "", status=0)
    yield "outlines", _frame(f'shape = "polygon"\nvertices = {_points(*3 * [(1, 1)])}', "vertices")
    yield "outlines", _frame('shape = "circle"\nradius = "1e300 mm"', "frame.radius")
    arc = ('shape = "drawn"\n[[frame.segments]]\nkind = "arc"\ncentre = ["0 mm", "0 mm"]\n'
           'radii = ["45 mm", "45 mm"]\nsweep = "0 deg"')
    yield "outlines", _frame(arc, r"frame.segments.0.sweep")
    rectangle, same = _lines((0, 0), (50, 0), (50, 40), (0, 40), (0, 0)), (b"", b"")
    for radius in (float("nan"), 0.0, -30.0):
        yield "dxf", _dxf(partial(_circle, radius), same, "radii_m")
    for count, weights in ((4, (1, 0, 0, 1)), (1, ()), (0, ())):
        yield "dxf", _dxf(_spline(count, weights), same, "weights positive|can be read")
    yield "dxf", _dxf(rectangle, (b"$INSUNITS\n 70\n4", b"$INSUNITS\n 70\n99"), "INSUNITS is 99")
    yield "dxf", _dxf(rectangle, (b"\n50.0\n", b"\nfifty\n"), "no DXF file")
    yield "dxf", _dxf(lambda space: space.add_lwpolyline(
        [(3, 2, 1e200), (3, 6, 0), (-3, 6, 1)], format="xyb", close=True), same, "a.dxf")
    zigzag = [(0.001 * place, float(place % 2)) for place in range(20_001)]
    yield "dxf", _dxf(_lines(*zigzag), same, "at most 1000")
    yield "step", _step("(55.,-25.,0.)", "(NaN,-25.,0.)", "a.step.*damaged")
    yield "step", _step("(-55.,-25.,0.)", "(NaN,-25.,0.)", "a.step.*far more time|damaged")
    yield "step", _step("(55.,-25.,0.)", "(-25.,55.,0.)", "a.step")
    yield "room for a plate", _frame('shape = "stadium"\nsemi_axes = ["25 mm", "40 mm"]', "",
                                     status=0)
    square = ('shape = "rounded_rectangle"\nsemi_axes = ["12.7 mm", "12.7 mm"]\n'
              'corner_radius = "0.3 mm"')
    for size in ("0.3 mm", "0.6 mm"):
        yield "room for a plate", _frame(square, "", f'radius = "{size}"', status=0)


def _surroundings() -> Iterator[tuple[str, Command]]:
    """Terminals, folders, options and signals."""
    plain = {"LC_ALL": "C", "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    for command in ("--help", "alpha --help", "materials", SOLVE):
        yield "ascii", Command(command, GOOD, "", 0, environment=plain)
    yield "other files", Command("material fit coupon.csv -o .", {
        "coupon.csv": TESTS, "material.toml": "mine = 1\n"}, "material.toml")
    yield "address", Command("sweep SWEEP.toml -o out --scheduler ''", {
        **GOOD, "SWEEP.toml": LOADS}, "--scheduler")
    yield "options", _data("diagnose data -o out --seed -1", "--seed", static=STATIC)
    yield "options", Command("map -o out --workers 999999", {}, "--workers")
    for noise in ("1e-300 kPa", "1e300 kPa"):
        yield "options", _coupon("--noise", COUPON, f"--noise '{noise}'")
    yield "options", Command("path specimen.toml --along mass --mass '20 g' --rig rig.toml", {
        **GOOD, "rig.toml": 'guide = "fixed"\n'}, "guide")
    simulate = "lumped simulate specimen.toml --mass '20 g' --signal signal.csv -o out"
    for step_s, status in ((1.0, 2), (0.001, 0)):
        rows = "".join(f"{row * step_s},{row % 3}\n" for row in range(200_000))
        yield "signals", Command(simulate, {**GOOD, "signal.csv": "t_s,voltage_kV\n" + rows},
                                 "2000000 samples" if status else "", status)
    yield "signals", Command("lumped simulate specimen.toml --mass '1e-12 g' -o out", GOOD, "mass")


def run(command: Command) -> Answer:
    """The command in a folder of its own, with nothing kept from earlier ones."""
    def limit() -> None:
        if command.largest_file is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, 2 * (command.largest_file,))

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, content in command.files.items():
            (folder / file).parent.mkdir(exist_ok=True)
            if content is None:
                os.mkfifo(folder / file)
            else:
                (folder / file).write_bytes(
                    content if isinstance(content, bytes) else content.encode())
        began = time.perf_counter()
        try:
            done = subprocess.run(
                [sys.executable, "-m", "tympan", *shlex.split(command.arguments)], cwd=folder,
                env=os.environ | {"TYMPAN_CACHE": "", **command.environment}, check=False,
                stdin=subprocess.DEVNULL, capture_output=True, timeout=120, preexec_fn=limit)
        except subprocess.TimeoutExpired:
            return Answer(-1, "no end\n", time.perf_counter() - began)
        return Answer(done.returncode, done.stderr.decode(errors="replace"),
                      time.perf_counter() - began)


def main() -> int:
    """One line a command; 1 where one ends otherwise than it has to."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", default="", help="kinds with this word")
    options = parser.parse_args()
    faults, slowest, count = 0, 0.0, 0
    for kind, command in commands():
        if options.only not in kind:
            continue
        answer = run(command)
        fault = answer.fault(command)
        faults, count = faults + bool(fault), count + 1
        if command.status == 2:
            slowest = max(slowest, answer.seconds)
        said = answer.error.strip().splitlines()
        print(f"{kind:16s} {answer.status:3d} {answer.seconds:5.2f} s  {fault or 'ok':12s} "
              f"{said[-1][:150] if said else ''}", flush=True)
    print(f"{count} commands, {faults} that end otherwise; slowest message after {slowest:.2f} s")
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
