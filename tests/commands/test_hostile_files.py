"""Nothing a file can say breaks a command: one message with file and key, status 2, at once."""

from __future__ import annotations

import os
import time
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.datasets import write_dataset
from tests.support.specimens import specimen_toml
from tympan.base.toml_reader import Table
from tympan.cli import main
from tympan.geometry.outlines import OUTLINES

SPECIMEN = specimen_toml()
LOADS = 'specimen = "oval.toml"\nmass = "17.9 g"\nvoltage = "1 kV"\n'
SAMPLE = '[sample]\nmethod = "sobol"\ncount = 8\n[sample.ranges]\n'
TEN = str([f"{size} mm" for size in range(1, 11)])
STATIC = "specimen,mass_g,voltage_kV,displacement_mm\n"
TRANSIENT = "specimen,mass_g,run,t_s,voltage_kV,displacement_mm\n"
COUPON = "mode,stretch,nominal_stress_kPa\n"

Refused = Callable[..., str]


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Refused:
    """What a command says that ends with status 2, in one line and two seconds of processing."""
    def _refused(*arguments: object) -> str:
        began = time.process_time()
        assert main([str(part) for part in arguments]) == 2
        assert time.process_time() - began < 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.count("\n") == 1
        return err

    return _refused


@pytest.mark.parametrize(("old", "new", "key", "words"), [
    ('"1 cm"', '"9**9**9**9 mm"', "plate.radius", "unknown unit"),
    ('"1 cm"', '"1 mm**9**9**9"', "plate.radius", "unknown unit"),
    ('"1 cm"', '"1 mm^99"', "plate.radius", "unknown unit"),
    ('"1 cm"', '"1 mm.__class__"', "plate.radius", "unknown unit"),
    ('"1 cm"', '"1 (((m" ', "plate.radius", "unknown unit"),
    ('"1 cm"', f'"1{"0" * 5000} mm"', "plate.radius", "such as"),
    ('"1 cm"', '"1e999 mm"', "plate.radius", "finite"),
    ('"1 cm"', '"1e300 mm"', "plate.radius", "at most 1e+30"),
    ("= 4.7", f"= {'1' * 5000}", "not valid TOML", "too many digits"),
    ("= 4.7", f"= 1{'0' * 400}", "membrane.relative_permittivity", "64 bits"),
    ("= 4.7", f"= {'[' * 3000}{']' * 3000}", "not valid TOML", "nested"),
    ("[plate]", f"[plate{'.plate' * 1000}]", "not valid TOML", "nested"),
    ("[plate]", f"plate{'.plate' * 100_000} = 1", "not valid TOML", "nested"),
    ("[plate]", f"{'k' * 501} = 1\n[plate]", f"frame.{'k' * 10}", "500 characters"),
    ("[plate]", '"two\\nlines" = 1\n[plate]', "frame.two\\nlines", "unknown key"),
], ids=range(15))
def test_specimens(tmp_path: Path, refused: Refused, old: str, new: str, key: str, words: str
                   ) -> None:
    file = tmp_path / "specimen.toml"
    file.write_text(SPECIMEN.replace(old, new, 1))
    said = refused("solve", file, "--mass", "1 g")
    assert f"{file}: " in said
    assert key in said
    assert words in said


def _points(*places: tuple[object, object]) -> str:
    return str([[f"{x} mm", f"{y} mm"] for x, y in places])


CORNERS = ((0, 0), (90, 0), (90, 80), (0, 80))
ARC = ('shape = "drawn"\n[[frame.segments]]\nkind = "arc"\ncentre = ["0 mm", "0 mm"]\n'
       'radii = ["45 mm", "45 mm"]\nsweep = "360 deg"')


@pytest.mark.parametrize(("frame", "key", "words"), [
    (f'shape = "polygon"\nvertices = {_points(*CORNERS[:2], *CORNERS[1:])}', "frame.vertices",
     "90, 0 mm is there twice"),
    (f'shape = "polygon"\nvertices = {_points(*3 * [(1, 1)])}', "frame.vertices", "three points"),
    (f'shape = "polygon"\nvertices = {_points((0, 0), ("1e300", 0), (0, 1))}', "frame.vertices.1",
     "finite"),
    (f'shape = "polygon"\nvertices = {_points((0, 0), ("1e20", 0), (0, 1))}', "frame.vertices.1",
     "within 1 km"),
    (f'shape = "polygon"\nvertices = {_points((0, 0), (90, 0), (30, 0))}', "frame",
     "half extents must be positive"),
    (f'shape = "polygon"\nvertices = {_points(*((x, x * x) for x in range(1001)))}', "frame",
     "at most 1000"),
    (f'shape = "spline"\nthrough = {_points(*CORNERS[:2], *CORNERS[1:])}', "frame.through",
     "90, 0 mm is there twice"),
    (ARC.replace("360", "0"), "frame.segments.0.sweep", "not 0"),
    (ARC.replace('"45 mm", ', '"0 mm", '), "frame.segments.0.radii", "from 1 um"),
], ids=range(9))
def test_outlines(tmp_path: Path, refused: Refused, frame: str, key: str, words: str) -> None:
    file = tmp_path / "specimen.toml"
    file.write_text(specimen_toml("hostile", frame))
    said = refused("solve", file, "--mass", "1 g")
    assert key in said
    assert words in said


@pytest.mark.parametrize("frame", ['shape = "polygon"\nvertices = ',
                                   'shape = "spline"\nthrough = '])
def test_the_first_point_may_stand_at_the_end_again(frame: str) -> None:
    open_one, closed = (OUTLINES.read(Table("frame.toml", tomllib.loads(frame + _points(*places))))
                        for places in (CORNERS, (*CORNERS, CORNERS[0])))
    assert open_one == closed


@pytest.mark.parametrize("name", ["pipe", "/dev/full", "folder", "long", "a\0b"])
def test_what_is_no_regular_file_of_a_sensible_size(tmp_path: Path, refused: Refused, name: str
                                                    ) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "long").write_bytes(b"# long\n" * 600_000)
    assert "cannot be read: " in refused("solve", tmp_path / name, "--mass", "1 g")
    if name == "pipe":
        data = write_dataset(tmp_path / "data")
        os.mkfifo(data / "static.csv")
        assert f"{data / 'static.csv'}: cannot be read" in refused("data", data)


@pytest.mark.parametrize(("text", "key", "words"), [
    (LOADS + "[grid]\n" + "\n".join(f'"k{key}" = {TEN}' for key in range(10)), "grid",
     "at most 1000000 specimens"),
    (LOADS + "[grid]\n" + "\n".join(f'"k{key}" = [1, 2]' for key in range(40)), "grid",
     "at most 1000000 specimens"),
    (LOADS + "[grid]\n" + "\n".join(f'"k{key}" = [1, 2]' for key in range(19)), "grid",
     "at most 2000000 values"),
    (LOADS + SAMPLE + "\n".join(f'"k{key}" = [1, 2]' for key in range(21_202)), "sample.ranges",
     "at most 1000 keys"),
    (LOADS + SAMPLE.replace("8", "1000000") + "\n".join(f'"k{key}" = [1, 2]' for key in range(9)),
     "sample.count", "at most 2000000 values"),
    (LOADS + SAMPLE + f'"k" = [1, 1{"0" * 400}]', "sample.ranges.k.1", "64 bits"),
    (LOADS + f'[grid]\n"membrane.prestretch.{"9" * 5000}" = [1, 2]', "grid", "500 characters"),
    (LOADS.replace("oval", "a\\u0000b"), "a\\x00b.toml", "no file has NUL in its name"),
    ('specimen = "oval.toml"\nvoltage = { from = "0 V", to = "1 kV", count = 10000 }\n'
     f"mass = {[f'{mass} g' for mass in range(1, 2000)]}", "voltage", "at most 10000000 cases"),
], ids=range(9))
def test_sweeps(tmp_path: Path, refused: Refused, text: str, key: str, words: str) -> None:
    (tmp_path / "oval.toml").write_text(SPECIMEN)
    file = tmp_path / "SWEEP.toml"
    file.write_text(text)
    said = refused("sweep", file, "-o", tmp_path / "out")
    assert str(tmp_path) in said
    assert key in said
    assert words in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("files", "place", "words"), [
    ({"static": STATIC + "".join(f"A,0,{voltage},2\n" for voltage in range(9))}, "mass",
     "must be above 0 in some reading"),
    ({"transient": TRANSIENT + "A,1,x,1e300,0,0\n"}, "transient.csv: line 2, column 4",
     "finite"),
    ({"transient": TRANSIENT + "A,1,x,1e10,0,0\n"}, "transient.csv: line 2, column 4",
     "within 1e9 s"),
    ({"transient": TRANSIENT + "A,1,x,0,0,0\nA,1,x,1e-300,0,0\n"},
     "transient.csv: line 3, column 4", "once in a run"),
    ({"transient": TRANSIENT + "A,1,x,0,0,1e300\n"}, "transient.csv: line 2, column 6", "finite"),
    ({"static": STATIC + "A,1,0,1e20\n"}, "static.csv: line 2, column 4", "within 10 m"),
    ({"coupon": COUPON + "uniaxial,1e10,1\n"}, "coupon.csv: line 2, column 2", "from 0.05 to 20"),
    ({"coupon": COUPON + "uniaxial,1.1,1e300\n"}, "coupon.csv: line 2, column 3", "finite"),
    ({"coupon": COUPON + "uniaxial,1.1,1e20\n"}, "coupon.csv: line 2, column 3", "within 1e9 kPa"),
], ids=range(9))
def test_readings(tmp_path: Path, refused: Refused, files: dict[str, str], place: str, words: str
                  ) -> None:
    folder = write_dataset(tmp_path / "data", **files)
    said = refused("diagnose", folder, "-o", tmp_path / "out")
    assert place in said
    assert words in said
