"""A release as a user gets it: built, installed into empty environments elsewhere, and tried.

``python -m benchmarks.release`` builds wheel and source archive, and the wheel once more from the
archive. Then it makes an empty environment for each Python of 3.11 to 3.13 that starts. It installs
the wheel without extras, and tries commands, Python, the paper's study and a part of the tests, all
outside of the checkout. Each extra is installed beside the plain packages, and tried. Versions are
those of ``requirements-dev.lock``; what pip adds beyond it is the newest. A table of megabytes and
processor seconds comes last. Nothing is taken from pip's cache, but downloading hardly takes a
processor: it comes on top. If all is well, wheel and archive are left in ``dist/``; if anything
fails, the exit status is 1.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]
#: What a release is built from.
SOURCES = ("base", "tables", "geometry", "fem", "studies", "reports", "tympan", "pyproject.toml",
           "README.md", "LICENSE")
#: What the tests need, in a folder without the sources of tympan.
TESTS = ("tests", "benchmarks", "pyproject.toml")

#: Interpreters that are tried where none are named.
PYTHONS = ("python3.11", "python3.12", "python3.13")

#: Run in a copy of the tree: the two wheels, straight and by way of the source distribution.
BUILD = """
import os, tarfile
from setuptools import build_meta
build_meta.build_wheel("straight")
archive = build_meta.build_sdist("source")
with tarfile.open(f"source/{archive}") as source:
    assert not any(member.issym() or member.islnk() for member in source)
    safe = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}
    source.extractall("source", **safe)
wheels = os.path.abspath("by_source")
os.chdir("source/" + archive.removesuffix(".tar.gz"))
build_meta.build_wheel(wheels)
"""

#: Tests of the plain install: none of them needs an extra.
SUBSET = ("tests/base", "tests/fem/film/test_laws.py", "tests/fem/film/test_law_range.py",
          "tests/geometry/test_outlines.py", "tests/reports/test_own_result.py",
          "tests/studies/test_path.py", "tests/studies/test_stroke.py",
          "tests/studies/test_wanted.py")
#: What they need beside tympan.
TEST_PACKAGES = ("hypothesis", "pytest")

#: Film of the trials.
OVAL = """
name = "oval"
[frame]
shape = "ellipse"
semi_axes = ["6 cm", "45 mm"]
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = [2.236, 2.236]
material = "vhb-4910"
"""

#: A script of the README's kind.
SCRIPT = """
import sys, tympan
assert "site-packages" in tympan.__file__, tympan.__file__
result = tympan.solve(tympan.load("oval.toml"), mass="17.9 g", voltage="3.5 kV")
assert result.status == "equilibrium" and 2e-3 < result.deflection_m < 4e-3, result
result.save("solved")
"""

#: How each script of an extra begins.
_HEAD = """
from pathlib import Path
import tympan
from tympan.cli import main
def run(line):
    assert main(line.split()) == 0, line
if __name__ == "__main__":
"""

#: Script that needs the package of each extra, as the body of its main part.
TRIALS = {
    "cad": """
    run("export oval.toml -o parts")
    text = Path("oval.toml").read_text()
    _, frame, rest = text.partition("[plate]")
    Path("drawn.toml").write_text('name = "drawn"\\n[frame]\\nshape = "step"\\ncurve = "outer"\\n'
                                  'file = "parts/oval-film.step"\\n' + frame + rest)
    run("solve drawn.toml --mass 17.9g")
""",
    "cluster": """
    from distributed import LocalCluster
    Path("SWEEP.toml").write_text('specimen = "oval.toml"\\nmass = "17.9 g"\\nvoltage = "1 kV"\\n'
                                  '[grid]\\n"plate.radius" = ["1 cm", "11 mm"]\\n')
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        run(f"sweep SWEEP.toml -o swept --scheduler {cluster.scheduler_address}")
""",
    "completion": """
    import contextlib, io
    with contextlib.redirect_stdout(io.StringIO()) as script, contextlib.suppress(SystemExit):
        main(["--print-completion", "bash"])
    assert "_shtab_tympan" in script.getvalue()
""",
    "control": """
    built = tympan.lumped.build(tympan.load("oval.toml"), mass="17.9 g", voltage=("0 kV", "3 kV"),
                                count=3)
    linear = tympan.lumped.linearise(built.models[0], voltage="2 kV", mass="17.9 g")
    assert linear.to_control().nstates >= 2
""",
    "explore": """
    import re, subprocess, sys, urllib.request
    explorer = subprocess.Popen([sys.executable, "-m", "tympan", "explore", "oval.toml",
                                 "--no-browser"], stderr=subprocess.PIPE, text=True)
    try:
        address = re.search(r"http://\\S+", explorer.stderr.readline())[0]
        cookies = urllib.request.HTTPCookieProcessor()
        assert urllib.request.build_opener(cookies).open(address, timeout=60).status == 200
        explorer.terminate()
        assert explorer.wait(60) == 143
    finally:
        explorer.kill()
""",
    "fast": """
    from tympan.fem.linear_solver import direct
    ordinary = tympan.solve(tympan.load("oval.toml"), mass="17.9 g").deflection_m
    direct.PARDISO_PAYS = 0
    import os
    os.environ["TYMPAN_CACHE"] = ""
    fast = tympan.solve(tympan.load("oval.toml"), mass="17.9 g").deflection_m
    assert "pypardiso" in __import__("sys").modules and abs(fast / ordinary - 1) < 1e-9
""",
    "sheets": """
    from openpyxl import Workbook
    book = Workbook()
    for row in (("specimen", "mass_g", "voltage_kV", "displacement_mm"), ("oval", 17.9, 0, 2.1),
                ("oval", 17.9, 3.5, 2.4)):
        book.active.append(row)
    Path("readings").mkdir()
    book.save("readings/static.xlsx")
    Path("readings/dataset.toml").write_text('name = "trial"\\n[[specimen]]\\n'
                                             'file = "../oval.toml"\\n')
    run("data readings")
""",
    "all": """
    from tympan.base.extras import EXTRAS, needs
    for extra in EXTRAS.values():
        needs(extra.package, "this trial")
    run("doctor")
""",
}


def processor_seconds() -> float:
    """Add up the processor time of all processes that have been run and have ended [s]."""
    used = os.times()
    return used.children_user + used.children_system


@dataclass
class Column:
    """What was found with one Python: words by their row of the table, and what failed."""

    version: str
    cells: dict[str, str] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)

    @contextmanager
    def row(self, name: str, timed: bool = True) -> Iterator[list[str]]:
        """Fill a cell with the words that the block adds, and its seconds if it is ``timed``.

        A process that fails ends the block and is noted.
        """
        words: list[str] = []
        began = processor_seconds()
        try:
            yield words
        except subprocess.CalledProcessError as error:
            self.failed.append(name)
            words.append("failed")
            print(f"{error.stdout or ''}{error.stderr or ''}".strip(), file=sys.stderr)
        if timed:
            words.append(f"{processor_seconds() - began:.0f} s")
        self.cells[name] = ", ".join(words)
        print(f"Python {self.version}: {name}: {self.cells[name]}", flush=True)


def run(python: Path | str, *arguments: str, cwd: Path, **variables: str) -> str:
    """Run a Python without the checkout on its path; answers what it printed.

    Raises
    ------
    subprocess.CalledProcessError
        When its exit status is not 0.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run([str(python), *arguments], cwd=cwd, check=True, text=True,
                          capture_output=True, env=environment | variables).stdout


def copied(names: Iterable[str], folder: Path) -> Path:
    """Copy files and folders of the checkout into a folder; answers the folder."""
    folder.mkdir()
    for name in names:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, symlinks=True,
                            ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, folder / name)
    return folder


def files_in(wheel: Path) -> list[str]:
    """List the files of a wheel, sorted."""
    return sorted(name for name in zipfile.ZipFile(wheel).namelist() if not name.endswith("/"))


def starting(pythons: Iterable[str]) -> Mapping[str, str]:
    """Find the version of each interpreter that starts and makes environments."""
    asking = "import ensurepip, sys, venv; print('%d.%d' % sys.version_info[:2])"
    found = {}
    for python in pythons:
        try:
            found[python] = run(python, "-c", asking, cwd=ROOT).strip()
        except (OSError, subprocess.CalledProcessError):
            print(f"{python}: does not start, or makes no environments")
    return found


def install(python: Path, *what: str) -> None:
    """Install packages with the locked versions, everything downloaded."""
    run(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-cache-dir",
        "--constraint", str(ROOT / "requirements-dev.lock"), *what, cwd=python.parent)


def environment(python: Path | str, folder: Path) -> Path:
    """Make an empty environment; answers its Python."""
    run(python, "-m", "venv", str(folder), cwd=folder.parent)
    return folder / "bin" / "python"


def megabytes(python: Path) -> float:
    """Add up the sizes of all files of an environment [MB]."""
    return sum(file.lstat().st_size for file in python.parents[1].rglob("*")) / 1e6


def built(python: str, folder: Path) -> tuple[Path, Path]:
    """Build both wheels and compare them; answers the one of the tree, and the archive."""
    tree = copied(SOURCES, folder / "tree")
    builder = environment(python, folder / "builder")
    install(builder, "setuptools")
    run(builder, "-c", BUILD, cwd=tree)
    wheel, = (tree / "straight").glob("*.whl")
    by_source, = (tree / "by_source").glob("*.whl")
    archive, = (tree / "source").glob("*.tar.gz")
    if files_in(wheel) != files_in(by_source):
        raise SystemExit(f"{archive.name} makes another wheel than the tree: "
                         f"{sorted({*files_in(wheel)} ^ {*files_in(by_source)})}")
    for file in (wheel, archive):
        print(f"{file.name}: {file.stat().st_size / 1e6:.1f} MB")
    return wheel, archive


def tried(python: str, version: str, wheel: Path, folder: Path) -> Column:
    """Install a wheel for a Python in a new folder, with and without extras, and try each."""
    folder.mkdir()
    column, plain = Column(version), environment(python, folder / "plain")
    variables = {"TYMPAN_CACHE": str(folder / "cache")}
    empty = megabytes(plain)
    with column.row("plain install") as words:
        install(plain, str(wheel))
        words.append(f"{megabytes(plain) - empty:.0f} MB")
    if column.failed:
        return column
    work = folder / "work"
    work.mkdir()
    (work / "oval.toml").write_text(OVAL, encoding="utf-8")
    number = wheel.name.split("-")[1]
    with column.row("commands and Python") as words:
        command = str(plain.with_name("tympan"))
        said = subprocess.run([command, "--version"], cwd=work, check=True, text=True,
                              capture_output=True).stdout
        loaded = run(plain, "-c", "import tympan; print('tympan', tympan.__version__)", cwd=work)
        if not said == loaded == f"tympan {number}\n":
            raise subprocess.CalledProcessError(1, command, said, loaded)
        run(plain, "-m", "tympan", "solve", "oval.toml", "--mass", "17.9 g", cwd=work, **variables)
        run(plain, "-m", "tympan", "doctor", cwd=work, **variables)
        run(plain, "-c", SCRIPT, cwd=work, **variables)
    with column.row("`tympan study`"):
        run(plain, "-m", "tympan", "study", "-o", "out", cwd=work, **variables)
    for name in TRIALS:
        tried_extra(column, name, wheel, folder, work)
    with column.row("tests") as words:
        install(plain, *TEST_PACKAGES)
        tests = copied(TESTS, folder / "tests")
        said = run(plain, "-m", "pytest", "-q", *SUBSET, cwd=tests)
        words.append(said.strip().rpartition("\n")[2].partition(" in ")[0])
    return column


def tried_extra(column: Column, name: str, wheel: Path, folder: Path, work: Path) -> None:
    """Install an extra beside a copy of the plain packages, and run its script.

    The copy's files are links: to copy them all would take longer than to install the extra.
    """
    with column.row(f"`tympan[{name}]`", timed=False) as words:
        extended = folder / name
        shutil.copytree(folder / "plain", extended, symlinks=True, copy_function=os.link)
        python = extended / "bin" / "python"
        before, began = megabytes(python), processor_seconds()
        install(python, f"{wheel}[{name}]")
        words += [f"{megabytes(python) - before:.0f} MB", f"{processor_seconds() - began:.0f} s"]
        script = work / f"try_{name}.py"
        script.write_text(_HEAD + TRIALS[name], encoding="utf-8")
        run(python, script.name, cwd=work, TYMPAN_CACHE=str(folder / "cache"))
    shutil.rmtree(extended)


def table(columns: Iterable[Column]) -> str:
    """Write a table in Markdown with a column for each Python."""
    columns = list(columns)
    rows = dict.fromkeys(name for column in columns for name in column.cells)
    lines = [["", *(f"Python {column.version}" for column in columns)],
             ["---"] * (1 + len(columns)),
             *([name, *(column.cells.get(name, "") for column in columns)] for name in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def main() -> int:
    """Build and try a release; 1 if anything fails."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("pythons", nargs="*", default=PYTHONS, help="interpreters to try")
    asked = parser.parse_args()
    pythons = starting(asked.pythons)
    if not pythons:
        print("no Python of 3.11 to 3.13 starts", file=sys.stderr)
        return 1
    with TemporaryDirectory(prefix="tympan-release-") as name:
        folder = Path(name)
        wheel, archive = built(next(iter(pythons)), folder)
        columns = [tried(python, version, wheel, folder / version)
                   for python, version in pythons.items()]
        failed = [f"Python {column.version}: {row}" for column in columns for row in column.failed]
        if not failed:
            (ROOT / "dist").mkdir(exist_ok=True)
            for file in (wheel, archive):
                shutil.copy(file, ROOT / "dist")
    print(f"\n{table(columns)}")
    for each in failed:
        print(f"failed: {each}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
