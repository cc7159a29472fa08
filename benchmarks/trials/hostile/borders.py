"""Empty values, files that a file may not name, files of another kind, limits of a shell."""

from __future__ import annotations

import io
from pathlib import Path

import ezdxf
from openpyxl import Workbook

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import (
    BODY,
    DATASET,
    GOOD,
    LOADS,
    SAMPLE,
    SOLVE,
    STATIC,
    VHB,
    of_dataset,
)

#: A line of a file that is nobody's business.
_SECRET = "root:x:0:0:root"
_ABROAD = "must be a relative path, at most 2 folders up"
_DRAWN = f'name = "film"\n[frame]\nshape = "dxf"\nfile = "{{}}"\n{BODY}{VHB}'


@group("empty values")
def empty_values() -> Cases:
    """As of a variable that the shell does not know: nothing is computed instead."""
    for option, line in (("--mass", "solve specimen.toml --mass ''"),
                         ("--mass", "solve specimen.toml --mass ' '"),
                         ("--voltage", f"{SOLVE} --voltage ''"), ("--rig", f"{SOLVE} --rig ''"),
                         ("-o/--output", "draw specimen.toml -o ''"),
                         ("SPECIMEN.toml", "solve '' --mass '1 g'"),
                         ("--mass", "force specimen.toml --to '1 mm' --mass ''")):
        yield Case(line, line, GOOD, f"{option}: given '': is empty",
                   check=lambda folder: "a file" if len(list(folder.iterdir())) > 1 else "")


def _dataset(name: str, keys: str, words: str, **files: str | bytes) -> Case:
    """What is said of a dataset with further keys."""
    return Case(name, "data data", {"data/dataset.toml": DATASET + keys, **{
        f"data/{file.replace('_', '.')}": content for file, content in files.items()}}, words)


@group("files elsewhere")
def files_elsewhere() -> Cases:
    """A file of somebody else's names no file of the user's, and no message quotes one."""
    never = "Traceback|root|x:0:0"
    for path in ("/etc/passwd", "../../../notes", "a/../../notes"):
        yield _dataset(f"table {path}", f'[columns.static]\nfile = "{path}"\n',
                       f"columns.static.file: given '{path}': {_ABROAD}")
        yield Case(f"specimen {path}", "data data", {
            "data/dataset.toml": f'name = "d"\n[[specimen]]\nfile = "{path}"\n',
            "data/static.csv": STATIC}, f"specimen.0.file: given '{path}': {_ABROAD}")
        yield Case(f"forces {path}", f"{SOLVE} --rig rig.toml", {
            **GOOD, "rig.toml": f'[[bias]]\nlaw = "table"\nfile = "{path}"\n'},
            f"bias.0.file: given '{path}': {_ABROAD}")
        yield Case(f"drawing {path}", SOLVE, {"specimen.toml": _DRAWN.format(path)},
                   f"frame.file: given '{path}': {_ABROAD}")
        yield Case(f"specimen of a sweep {path}", "sweep SWEEP.toml -o out", {
            "SWEEP.toml": LOADS.replace("specimen.toml", path)},
            f"specimen: given '{path}': {_ABROAD}")
    notes = {"notes": f"{_SECRET}\n"}
    yield Case("no table", "data data", {
        "data/dataset.toml": DATASET + '[columns.static]\nfile = "../notes"\n', **notes},
        "notes: line 1: has no heading that is known", never=never)
    yield Case("no table with a heading", "data data", {
        "data/dataset.toml": DATASET + '[columns.static]\nfile = "../notes"\n'
                                       'displacement_mm = "Weg"\n', **notes},
        "notes: line 1: given 'Weg': has no line with this heading", never=never)
    yield Case("no drawing", SOLVE, {"specimen.toml": _DRAWN.format("notes"), **notes},
               "is no DXF file that can be read: it is damaged", never=never)
    yield Case("no specimen", "solve notes --mass '1 g'", notes, "notes: is not valid TOML",
               never=never)


@group("files of another kind")
def other_kinds() -> Cases:
    """The message says what the file is of, what takes it, and how to get the one needed."""
    rig = {"rig.toml": 'spring = "5 N/m"\n'}
    data = {"data/dataset.toml": DATASET}
    sweep = {"SWEEP.toml": LOADS + SAMPLE + '"plate.radius" = ["8 mm", "15 mm"]\n'}
    for line, words in (("lumped export specimen.toml -o out", "lumped build specimen.toml"),
                        ("design specimen.toml -o out", r"\[want\]"),
                        ("study specimen.toml -o out", "specimens = "),
                        ("sweep specimen.toml -o out", r"\[grid\]"),
                        (f"{SOLVE} --rig specimen.toml", "--rig|gravity"),
                        ("tolerance specimen.toml --tolerances specimen.toml", r"\[batch\]")):
        yield Case(line, line, GOOD,
                   f"^tympan: specimen.toml: is the file of a specimen, .*{words}")
    for name, files in (("rig.toml", rig), ("data/dataset.toml", data), ("SWEEP.toml", sweep)):
        yield Case(f"solve {name}", f"solve {name} --mass '1 g'", files,
                   rf"^tympan: {name}: is the file of a \w+, not of a specimen: .*tak")


def _workbook(*sheets: str) -> bytes:
    """A workbook whose first sheet is empty, with others of these names."""
    book, content = Workbook(), io.BytesIO()
    for name in sheets:
        book.create_sheet(name).append(["a", "b"])
    book.save(content)
    return content.getvalue()


@group("layouts")
def layouts() -> Cases:
    """Layouts that contradict themselves."""
    def layout(name: str, keys: str, words: str) -> Case:
        return _dataset(name, f"[columns.static]\n{keys}\n", words, static_csv=STATIC)

    yield layout("headings left out", "skip_lines = [1]", "skip_lines: given 1: has the headings")
    yield layout("half a line", "skip_lines = [2.5]", "skip_lines: given 2.5")
    mapped = 'displacement_mm = "displacement_mm"\nignore = ["displacement_mm"]'
    yield layout("read and ignored", mapped, "ignore: given 'displacement_mm': is ignored and read")
    yield layout("filled and ignored", 'fill = ["order"]\nignore = ["order"]', "ignored and filled")
    yield layout("needed and ignored", 'ignore = ["displacement_mm"]', "displacement_mm is missing")
    yield _dataset("empty first sheet", "", "sheet 'Sheet': is empty; .*'Messung', 'Notes'",
                   static_xlsx=_workbook("Messung", "Notes"))
    yield _dataset("workbook of no workbook", "", "is no workbook that can be read",
                   static_xlsx=b"PK\x03\x04" + bytes(range(256)))


@group("tables of small steps")
def small_steps() -> Cases:
    """Steps over which no slope is a number, and tables of too few points."""
    def table(name: str, places: str, words: str) -> Case:
        return Case(name, f"{SOLVE} --rig rig.toml", {**GOOD, "rig.toml": (
            f'[[bias]]\nlaw = "table"\ndisplacement = {places}\nforce = ["0 N", "1 N"]\n')}, words)

    yield table("one point", '["1 mm"]', "bias.0.displacement: .*at least 2 numbers")
    yield table("1e-300 mm", '["0 mm", "1e-300 mm"]', "bias.0.displacement: .*by 1 nm at least")
    simulate = "lumped simulate specimen.toml --mass '20 g' -o out"
    yield Case("1e-300 s", f"{simulate} --signal a.csv", {
        **GOOD, "a.csv": "t_s,voltage_kV\n0,0\n1e-300,1\n"}, "a.csv: line 3.*by 1 ns at least")
    yield Case("step of 1e-300 s", f"{simulate} --duration '1e-300 s'", GOOD, "duration: .*1 ns at")
    yield of_dataset("transient of 1e-300 s", "data data", "within 1 ns",
                     transient="specimen,mass_g,run,t_s,voltage_kV,displacement_mm\n"
                               "oval,17.9,a,0,0,2\noval,17.9,a,1e-300,1,2\n")


def _draw_rectangle(folder: Path) -> None:
    document = ezdxf.new(units=ezdxf.units.MM)
    document.modelspace().add_lwpolyline([(0, 0), (120, 0), (120, 90), (0, 90)], close=True)
    document.saveas(folder / "a.dxf")


#: A command whose shell allows so much processor time [s], or memory [kB], as queues do.
_ULIMIT = ("import os, sys; os.execvp('sh', ['sh', '-c', 'ulimit {} && exec \"$0\" -m tympan "
           "\"$@\"', sys.executable, *sys.argv[1:]])")


@group("limits of a shell")
def limits_of_a_shell() -> Cases:
    for limit in ("-t 20", "-v 3500000"):
        yield Case(f"ulimit {limit}", SOLVE, {"specimen.toml": _DRAWN.format("a.dxf")}, status=0,
                   shows="equilibrium", prepare=_draw_rectangle,
                   program=("-c", _ULIMIT.format(limit)))
