"""Borders of what is accepted: empty values, files elsewhere, files of another kind, full disks."""

from __future__ import annotations

import io
import os
import resource
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import ezdxf
import pytest
from openpyxl import Workbook

from benchmarks.trials.fuzz.contents import DATASET, STATIC
from benchmarks.trials.python_words import words_of_python
from tests.support.datasets import write_dataset
from tests.support.specimens import OVAL, specimen_toml
from tympan.base.errors import InputError
from tympan.base.file_kinds import KINDS
from tympan.base.process.folder import MANIFEST, alone
from tympan.base.read_file import beside
from tympan.cli import main
from tympan.options import save_and_draw
from tympan.reports import rebuild
from tympan.studies.case import CaseResult
from tympan.studies.data.dataset import read_dataset
from tympan.studies.data.draft import draft
from tympan.studies.files import remove, replaced, write_text

SOLVE = ["solve", "oval.toml", "--mass", "1 g"]
SWEEP = ('specimen = "oval.toml"\nmass = "1 g"\nvoltage = "1 kV"\n[grid]\n'
         '"plate.radius" = ["1 cm"]\n')


@pytest.fixture
def said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """What a command says that ends with status 2, in one line without words of Python."""
    monkeypatch.chdir(tmp_path)
    Path("oval.toml").write_text(specimen_toml())

    def _said(*arguments: str) -> str:
        assert main(arguments) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert not words_of_python(err)
        return err

    return _said


@pytest.mark.parametrize(("arguments", "name"), [
    (["solve", "oval.toml", "--mass", ""], "--mass"), (["solve", "oval.toml", "--mass", " "],
                                                       "--mass"),
    ([*SOLVE, "--voltage", ""], "--voltage"), ([*SOLVE, "--rig", ""], "--rig"),
    ([*SOLVE, "-o", ""], "-o/--output"), (["solve", "", "--mass", "1 g"], "SPECIMEN.toml"),
    (["force", "oval.toml", "--to", "1 mm", "--mass", ""], "--mass"),
    (["lumped", "export", "", "-o", "x"], "MODEL.lumped.toml")])
def test_an_empty_value_is_a_missing_one(said, arguments: list[str], name: str) -> None:
    assert said(*arguments).startswith(f"tympan: {name}: given '': is empty")
    assert [file.name for file in Path().iterdir()] == ["oval.toml"]


@pytest.mark.parametrize(("arguments", "words"), [
    (["curve", "oval.toml", "--mass", "10 g; 20 g"], 'must have commas between quantities, such '
                                                     'as "10 g, 20 g"'),
    (["solve", "oval.toml", "--mass", "10 g, 20 g"], "must be one: this question"),
    (["solve", "oval.toml", "--weight", "1 g"], "did you mean --mass?"),
    (["solve", "oval.toml", "--potential", "1 g"], "did you mean --voltage?"),
    (["draw", "oval.toml", "--weight", "1 g"], "unknown option: known are"),
    ([*SOLVE, "--refine", "much"], "--refine: given 'much': must be a number"),
    (["map", "-o", "x", "--workers", "2.5"], "--workers: given '2.5': must be a whole number")])
def test_options_that_nearly_are_right(said, arguments: list[str], words: str) -> None:
    assert words in said(*arguments)


def test_help_shows_no_hidden_option(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["alpha", "--help"])
    assert "SUPPRESS" not in capsys.readouterr().out


#: Names of files as files may have them, and as they may not.
NEAR = ("a.csv", "b/a.csv", "../a.csv", "../../b/a.csv", "./a.csv")
FAR = ("/etc/passwd", "../../../a.csv", "b/../a.csv", "b/../../../a.csv", "../b/../../../a")


def test_files_name_files_that_are_near() -> None:
    assert [beside("data", name) for name in NEAR] == [Path("data") / name for name in NEAR]
    for name in FAR:
        with pytest.raises(InputError, match="must be a relative path, at most 2 folders up"):
            beside("data", name)


@pytest.mark.parametrize("name", FAR)
@pytest.mark.parametrize(("command", "file", "text"), [
    (["data", "data"], "data/dataset.toml", DATASET + '[columns.static]\nfile = "{}"\n'),
    (["data", "data"], "data/dataset.toml", 'name = "d"\n[[specimen]]\nfile = "{}"\n'),
    ([*SOLVE, "--rig", "rig.toml"], "rig.toml", '[[bias]]\nlaw = "table"\nfile = "{}"\n'),
    ([*SOLVE, "--rig", "rig.toml"], "rig.toml",
     '[[bias]]\nlaw = "film"\nspecimen = "{}"\ndistance = "2 cm"\nrod = "2 cm"\n'),
    (["solve", "film.toml", "--mass", "1 g"], "film.toml",
     specimen_toml().replace(OVAL, 'shape = "dxf"\nfile = "{}"')),
    (["sweep", "SWEEP.toml", "-o", "out"], "SWEEP.toml", SWEEP.replace("oval.toml", "{}")),
    (["sweep", "SWEEP.toml", "-o", "out"], "SWEEP.toml", 'rig = "{}"\n' + SWEEP),
    (["study", "STUDY.toml", "-o", "out"], "STUDY.toml", 'specimens = ["{}"]\n'),
    (["design", "DESIGN.toml", "-o", "out"], "DESIGN.toml",
     'specimen = "{}.toml"\n[want]\nstroke = "largest"\n[vary]\n'
     '"plate.radius" = ["8 mm", "12 mm"]\n'),
], ids=range(9))
def test_files_far_away_are_not_read(said, command: list[str], file: str, text: str, name: str
                                     ) -> None:
    Path(file).parent.mkdir(exist_ok=True)
    Path(file).write_text(text.replace("{}", name))
    message = said(*command)
    assert message.startswith(f"tympan: {file}: ")
    assert f": given '{name}" in message
    assert "must be a relative path, at most 2 folders up" in message


def test_a_file_that_is_no_table_is_not_quoted(said) -> None:
    write_dataset(Path("data"))
    Path("secret").write_text("root:x:0:0:secret\n")
    for keys in ("", 'displacement_mm = "Weg"\n'):
        Path("data/dataset.toml").write_text(
            DATASET + f'[columns.static]\nfile = "../secret"\n{keys}')
        message = said("data", "data")
        assert message.startswith("tympan: data/../secret: line 1: ")
        assert "root" not in message


def test_a_draft_far_from_its_table_is_refused(tmp_path: Path) -> None:
    (tmp_path / "Messung.csv").write_text("Weg (mm),Kraft (N)\n0,0\n1,0.1\n", encoding="utf-8")
    assert '"../../Messung.csv"' in draft(tmp_path / "Messung.csv", folder=tmp_path / "a/b").text
    with pytest.raises(InputError, match="at most 2 folders up"):
        draft(tmp_path / "Messung.csv", folder=tmp_path / "a/b/c").text  # noqa: B018


#: A small file of every kind.
OF_KIND = {
    "specimen": specimen_toml(), "rig": 'spring = "5 N/m"\n', "dataset": DATASET, "sweep": SWEEP,
    "requirements": 'specimen = "oval.toml"\n[want]\nstroke = "largest"\n[vary]\n',
    "study": 'specimens = ["oval.toml"]\n', "lumped model": "[[circle]]\n[specimen]\n"}
#: What needs a kind.
NEEDS = {
    "specimen": ["solve", "FILE", "--mass", "1 g"], "rig": [*SOLVE, "--rig", "FILE"],
    "sweep": ["sweep", "FILE", "-o", "out"], "study": ["study", "FILE", "-o", "out"],
    "requirements": ["design", "FILE", "-o", "out"],
    "lumped model": ["lumped", "export", "FILE", "-o", "out"],
    "tolerances": ["tolerance", "oval.toml", "--tolerances", "FILE"]}


@pytest.mark.parametrize("needed", NEEDS)
def test_a_file_of_another_kind_is_named_with_what_takes_it(said, needed: str) -> None:
    for kind in OF_KIND.keys() - {needed}:
        Path("file.toml").write_text(OF_KIND[kind])
        message = said(*["file.toml" if word == "FILE" else word for word in NEEDS[needed]])
        assert message.startswith(f"tympan: file.toml: is the file of {KINDS[kind].words}, not of "
                                  f"{KINDS[needed].words}: {KINDS[kind].taken}. ")
    if needed == "lumped model":
        Path("film.toml").write_text(OF_KIND["specimen"])
        assert "tympan lumped build film.toml -o DIR writes one" in said(
            "lumped", "export", "film.toml", "-o", "out")


@pytest.mark.parametrize(("keys", "words"), [
    ("skip_lines = [1]", "columns.static.skip_lines: given 1: has the headings"),
    ("skip_lines = [2.5]", "skip_lines: given 2.5: must be the number of a line"),
    ('displacement_mm = "displacement_mm"\nignore = ["displacement_mm"]',
     "columns.static.ignore: given 'displacement_mm': is ignored and read"),
    ('fill = ["order"]\nignore = ["order"]', "is ignored and filled"),
    ('ignore = ["displacement_mm"]', "the column displacement_mm is missing")])
def test_a_layout_that_contradicts_itself_is_refused(said, keys: str, words: str) -> None:
    Path("data").mkdir()
    Path("data/static.csv").write_text(STATIC)
    Path("data/dataset.toml").write_text(f"{DATASET}[columns.static]\n{keys}\n")
    assert words in said("data", "data")


def test_one_of_our_columns_may_be_ignored(tmp_path: Path) -> None:
    (tmp_path / "static.csv").write_text(STATIC)
    (tmp_path / "dataset.toml").write_text(DATASET + '[columns.static]\nignore = ["order"]\n')
    sheet = read_dataset(tmp_path).sheets[0]
    assert "order" not in sheet.places
    assert len(sheet) == 6


def test_a_workbook_with_an_empty_first_sheet_names_the_others(said) -> None:
    book, content = Workbook(), io.BytesIO()
    book.create_sheet("Messung").append(["a"])
    book.save(content)
    Path("data").mkdir()
    Path("data/dataset.toml").write_text(DATASET)
    Path("data/static.xlsx").write_bytes(content.getvalue())
    assert ("static.xlsx: sheet 'Sheet': is empty; there are also the sheets 'Messung': call the "
            "one to be read 'static', or put it first") in said("data", "data")


@pytest.mark.parametrize(("rig", "words"), [
    ('law = "table"\ndisplacement = ["1 mm"]\nforce = ["1 N"]',
     "bias.0.displacement: given '1 mm': must be at least 2 numbers"),
    ('law = "table"\ndisplacement = ["0 mm", "1e-300 mm"]\nforce = ["1 N", "2 N"]',
     "bias.0.displacement: given '0 mm, 1e-300 mm': must grow"),
    ('law = "buckled_beam"\nlength = "4 cm"\nwidth = "5 mm"\nthickness = "0.2 mm"\n'
     'modulus = "3 GPa"\ncompression = "0.1 mm"\nnumber = 2.5',
     "bias.0.number: given 2.5: must be a whole number from 1 to 1000"),
    ('law = "buckled_beam"\nlength = "4 mm"\nwidth = "5 mm"\nthickness = "20 mm"\n'
     'modulus = "3 GPa"\ncompression = "0.1 mm"',
     "bias.0.thickness: given '20 mm': must be at most a tenth of the length")], ids=range(4))
def test_mechanisms_that_cannot_be(said, rig: str, words: str) -> None:
    Path("rig.toml").write_text(f"[[bias]]\n{rig}\n")
    assert f"tympan: rig.toml: {words}" in said(*SOLVE, "--rig", "rig.toml")


def test_a_drawing_is_read_under_hard_limits(tmp_path: Path) -> None:
    """Of processor time and memory, as queues set them: they cannot be raised."""
    document = ezdxf.new(units=ezdxf.units.MM)
    document.modelspace().add_lwpolyline([(0, 0), (120, 0), (120, 90), (0, 90)], close=True)
    document.saveas(tmp_path / "a.dxf")
    file = tmp_path / "film.toml"
    file.write_text(specimen_toml().replace(OVAL, 'shape = "dxf"\nfile = "a.dxf"'))

    def limit() -> None:
        for kind, most in ((resource.RLIMIT_CPU, 20), (resource.RLIMIT_AS, 3 << 30)):
            resource.setrlimit(kind, (most, most))

    read = ("import sys; from pathlib import Path; from tympan.fem.film.library import "
            "load_specimen; print(load_specimen(Path(sys.argv[1])).frame.semi_axes)")
    done = subprocess.run([sys.executable, "-c", read, str(file)], capture_output=True, text=True,
                          check=False, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
                          preexec_fn=limit)
    assert (done.stderr, done.stdout) == ("", "(0.06, 0.045)\n")


def _content(folder: Path) -> dict[str, str]:
    return {file.name: file.read_text() for file in folder.iterdir()}


def test_a_result_is_written_with_its_pictures_or_not_at_all(tmp_path: Path) -> None:
    """Whatever fails: a disk that is full, a signal."""
    folder = tmp_path / "out"

    def write(failure: BaseException | None, *texts: tuple[str, str], without: str = "") -> None:
        with alone(folder), replaced(folder, ["a.png"]):
            remove(folder, *([without] if without else []))
            for name, text in texts:
                write_text(folder / name, text)
            if failure is not None:
                raise failure

    for failure in (InputError("cannot be written"), KeyboardInterrupt()):
        with pytest.raises(type(failure)):
            write(failure, ("a.json", "new"))
        assert not folder.exists()
    write(None, ("a.json", "old"), ("a.csv", "old"), ("a.png", "old"))
    before = _content(folder)
    assert set(before) == {"a.json", "a.csv", "a.png", MANIFEST}
    with pytest.raises(KeyboardInterrupt):
        write(KeyboardInterrupt(), ("a.json", "new"), ("a.json", "newer"), ("a.vtu", "new"),
              without="a.csv")
    assert _content(folder) == before
    write(None, ("a.json", "new"))
    assert _content(folder).keys() == {"a.json", "a.csv", MANIFEST}
    assert (folder / "a.json").read_text() == "new"


def test_a_command_leaves_no_result_without_its_picture(tmp_path: Path,
                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    """As of a disk that is full when the picture is drawn."""
    def full(*_: object) -> list[Path]:
        raise InputError("cannot be written: No space left on device", file="a.png")

    monkeypatch.setattr(rebuild, "draw_result", full)
    result = CaseResult(specimen="oval", mass_kg=0.0, voltage_V=0.0, status="not_converged",
                        dofs=1, wall_s=0.0, warnings=())
    options = Namespace(output=tmp_path / "out", command="solve")
    with pytest.raises(InputError, match="No space left"), alone(options.output):
        save_and_draw(options, result)
    assert not options.output.exists()
