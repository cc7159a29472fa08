"""Tables, memory, the cache, and packages of users' own."""

from __future__ import annotations

import io
import os
import sqlite3
import subprocess
import sys
import zipfile
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import (
    COUPON,
    DATASET,
    GOOD,
    SOLVE,
    SPECIMEN,
    STATIC,
    of_dataset,
)
from tympan.geometry.mesh import from_bytes, to_bytes

#: A command with at most so much memory [bytes].
_SHORT = 700 << 20
_LIMITED = ("-c", f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({_SHORT}, {_SHORT})); "
                  "from tympan.__main__ import run_command; run_command()")

GERMAN = STATIC.replace(",", ";").replace(".", ",")
_SPREADSHEET = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
_SHEET = "xl/worksheets/sheet1.xml"


def workbook(part: str, before: str, more: str) -> bytes:
    """A workbook of readings of which one part has more text before a word."""
    from openpyxl import Workbook

    book, plain, packed = Workbook(), io.BytesIO(), io.BytesIO()
    for line in STATIC.splitlines():
        book.active.append(line.split(","))
    book.save(plain)
    with (zipfile.ZipFile(plain) as old,
          zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as new):
        for name in old.namelist():
            text = old.read(name).decode()
            new.writestr(name, text.replace(before, more + before, 1) if name == part else text)
    return packed.getvalue()


@group("tables")
def tables() -> Cases:
    for command in ("data data", "diagnose data -o out"):
        yield of_dataset(f"both decimal marks, {command[:4]}", command,
                         "static.csv: line 3.*'1.000': can be read as 1000.*or as 1 ",
                         static=GERMAN.replace(";1;", ";1.000;"))
    yield of_dataset("thousands after hundreds", "data data", "line 3.*'1.000'.*line 2 has '500'",
                     static=STATIC.replace(",0,2.00", ",500,2.00").replace(",1,2", ",1.000,2"))
    for encoding in ("utf-16", "cp1252", "utf-8-sig"):
        content = ("sep=;\n" + GERMAN).encode(encoding)
        yield Case(f"sep=; in {encoding}", "data data", _dataset("static.csv", content), status=0,
                   shows="static.csv     6 readings")
    yield of_dataset("60000 columns", "data data", "at most 1000 columns",
                     static=",".join(f"A {mass} g displacement_mm" for mass in range(60_000)))
    yield of_dataset("50 million cells", "data data", "at most 10000000 cells",
                     static="specimen;mass_g\n" + 48_000_000 * ";" + "\n")
    for name, change, words in (
            ("unpacks to 400 MB", (_SHEET, "<sheetData>", 100_000_000 * "<a/>"),
             "unpack to at most 100 MB"),
            ("declares a whole sheet", (_SHEET, "<row ", '<row r="1048576"><c r="XFD1"/></row>'),
             "at most 300000 rows|at most 1000 columns"),
            ("shared texts", ("xl/workbook.xml", "<sheets>", 200_000 * "<a/>"), "at most 100000"),
            ("styles", ("xl/styles.xml", "<fonts", 10_000_000 * "<a/>"), "at most 100000 tags"),
            ("entities", (_SHEET, "<worksheet", "<!DOCTYPE a [<!ENTITY b 'c'>]>"), "words of its")):
        yield Case(f"workbook: {name}", "data data", _dataset("static.xlsx", workbook(*change)),
                   f"static.xlsx: .*{words}")
    yield Case("coupons in UTF-16, cut", "material fit coupon.csv -o out", {
        "coupon.csv": COUPON.encode("utf-16")[:-1]}, "coupon.csv: is not UTF-16 text")
    yield Case("signal of no text", "lumped simulate specimen.toml --mass '20 g' --signal a.csv "
               "-o out", {**GOOD, "a.csv": b"t_s,voltage_kV\n0,\x01\n"}, "a.csv: line 2.*no text")


def _dataset(name: str, content: bytes) -> dict[str, str | bytes | None]:
    return {"data/dataset.toml": DATASET, f"data/{name}": content}


@group("memory")
def memory() -> Cases:
    for refine in (1, 20):
        yield Case(f"700 MB, refine {refine}", f"{SOLVE} --json --refine {refine}", GOOD,
                   "^tympan: memory is short", status=1, never="Traceback|deflection",
                   seconds=60.0, program=_LIMITED)


def _cached(damage: Callable[[Path], object], folder: Path) -> None:
    """A cache that a first command fills, damaged."""
    subprocess.run([sys.executable, "-m", "tympan", "solve", "specimen.toml", "--mass", "1 g"],
                   cwd=folder, env=os.environ | {"TYMPAN_CACHE": "cache"}, check=True,
                   stdout=subprocess.DEVNULL)
    damage(folder / "cache" / "films.sqlite")


def _sql(statement: str, file: Path) -> None:
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute(statement)


def _cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:5000])


def _in_place(make: Callable[[Path], object], file: Path) -> None:
    file.unlink()
    make(file)


def _scaled(file: Path) -> None:
    with closing(sqlite3.connect(file)) as connection, connection:
        (content,), = connection.execute("SELECT content FROM meshes")
        mesh = from_bytes(content)
        mesh.doflocs[:] *= 1.01
        connection.execute("UPDATE meshes SET content = ?", (to_bytes(mesh),))


_DAMAGES: dict[str, Callable[[Path], object]] = {
    "cut": _cut,
    "empty": lambda file: file.write_bytes(b""),
    "text": lambda file: file.write_text("no database\n" * 100),
    "folder": partial(_in_place, Path.mkdir),
    "pipe": partial(_in_place, os.mkfifo),
    "link": partial(_in_place, lambda file: file.symlink_to("/dev/full")),
    "column more": partial(_sql, "ALTER TABLE meshes ADD COLUMN more"),
    "table missing": partial(_sql, "DROP TABLE meshes"),
    "another table": partial(_sql, "CREATE TABLE urls (id INTEGER)"),
    "text as content": partial(_sql, "UPDATE meshes SET content = 'text'"),
    "no content": partial(_sql, "UPDATE meshes SET content = NULL"),
    "bits": partial(_sql, "UPDATE meshes SET content = zeroblob(length(content))"),
    "scaled mesh": _scaled,
}


@group("cache")
def cache() -> Cases:
    """Each with the deflection of the first command, which had no cache."""
    here = {"TYMPAN_CACHE": "cache"}
    for name, damage in _DAMAGES.items():
        yield Case(name, f"{SOLVE} --json", GOOD, "^$", status=0,
                   shows=r'"deflection_m": 0.000130732', never="Traceback", environment=here,
                   prepare=partial(_cached, damage))
    for home in ("/nowhere", ""):
        program = ("-c", "import os, pwd; os.environ.pop('TYMPAN_CACHE'); "
                         "from tympan.__main__ import run_command; run_command()")
        yield Case(f"home {home or 'empty'}", f"{SOLVE} --json", GOOD, "^$", status=0,
                   shows=r'"deflection_m": 0.000130732', program=program,
                   environment={"HOME": home, "XDG_CACHE_HOME": ""})


_ACTS = {
    "exits": "import sys; sys.exit(0)",
    "exits at once": "import os; os._exit(0)",
    "interrupts": "raise KeyboardInterrupt",
    "raises": "raise RuntimeError('not\\ntoday')",
    "prints": "import os\nprint('A')\nos.write(1, b'B')\nos.system('echo C')\nraise GeneratorExit",
    "logs": "import logging, sys\nlogging.basicConfig(stream=sys.stdout, level=0)\nlogging.info(1)",
    "goes elsewhere": "import os, sys\nos.chdir('/')\nos.environ.clear()\nsys.stdout = None",
    "says farewell": "import atexit\natexit.register(print, 'A', flush=True)",
}


@group("packages")
def packages() -> Cases:
    """A law that does nothing but this: asked for, one line; else as if it were not there."""
    odd = SPECIMEN.replace('material = "vhb-4910"\n', "") + '[membrane.material]\nlaw = "odd"\n'
    for name, act in _ACTS.items():
        files: dict[str, str | bytes | None] = {
            **GOOD, "odd.toml": odd, "site/odd_law.py": act + "\n",
            "site/odd-1.dist-info/METADATA": "Metadata-Version: 2.1\nName: odd\nVersion: 1\n",
            "site/odd-1.dist-info/entry_points.txt": "[tympan.laws]\nodd = odd_law\n"}
        path = {"PYTHONPATH": os.pathsep.join(filter(None, [
            "site", str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH", "")]))}
        yield Case(f"{name}, asked for", "solve odd.toml --mass '1 g' --json", files,
                   "^tympan: package odd, entry point 'odd' of tympan.laws: ", environment=path,
                   plain=False)
        yield Case(f"{name}, not asked for", f"{SOLVE} --json", files, "^$", status=0,
                   shows="^{.*}\n$", environment=path)
