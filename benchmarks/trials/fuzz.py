"""Files as nobody would write them: whatever they say, reading ends soon, with a message or not.

    python -m benchmarks.trials.fuzz --minutes 60 --seed 1

Files that can be read are changed, a few places at a time: keys, numbers, units, lines, bytes. A
find is any exception but InputError, more than two seconds of processor time, or the end of the
process. Batches run in processes of their own; what one read last is kept in its folder.
"""

from __future__ import annotations

import argparse
import re
import secrets
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import ezdxf
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.outlines import OUTLINES, check_outline, drawings
from tympan.geometry.toml_reader import Table
from tympan.studies.data.checks import summary
from tympan.studies.data.dataset import read_dataset
from tympan.studies.optimise.problem import read_problem
from tympan.studies.signals import read_signal
from tympan.studies.study import read_study
from tympan.studies.sweep.plan import read_sweep

#: Time of a batch on the clock [s], and its examples.
_PATIENCE, _BATCH = 1800, 500

FILM = """[membrane]
thickness = "1 mm"
prestretch = [2.236, 2.236]
relative_permittivity = 4.7
"""
BODY = """[plate]
shape = "circle"
radius = "1 cm"
offset = ["2 mm", "0 mm"]
""" + FILM
OVAL = 'name = "oval"\n[frame]\nshape = "ellipse"\nsemi_axes = ["6 cm", "45 mm"]\n' + BODY
SPECIMENS = {
    "oval": OVAL + 'material = "vhb-4910"\n[electrode]\nmargin_frame = "1 mm"\n'
                   '[electrode.outline]\nshape = "circle"\nradius = "3 cm"\n',
    "ogden": OVAL + '[membrane.material]\nlaw = "ogden"\nmu = ["16 kPa", "0.02 kPa"]\n'
                    'alpha = [2, 4]\nrange = [0.5, 6]\n[[membrane.branch]]\nmodulus = "1 MPa"\n'
                    'time = "30 s"\n[[membrane.branch]]\nmodulus = "20 kPa"\ntime = "1 h"\n',
    "mounted": OVAL + 'material = "vhb-4910"\nmounted = "2 days"\n',
    "polygon": 'name = "polygon"\n[frame]\nshape = "polygon"\nfillet = "2 mm"\nrotation = "5 deg"\n'
               'vertices = [["0 mm", "0 mm"], ["90 mm", "0 mm"], ["90 mm", "80 mm"], '
               '["0 mm", "80 mm"]]\n' + BODY + 'material = "vhb-4910"\n',
    "spline": 'name = "spline"\n[frame]\nshape = "spline"\nthrough = [["60 mm", "0 mm"], '
              '["0 mm", "50 mm"], ["-60 mm", "0 mm"], ["0 mm", "-50 mm"]]\n' + BODY
              + '[membrane.material]\nlaw = "gent"\nmu = "18 kPa"\nj_lim = 110\n',
    "drawn": 'name = "drawn"\n' + BODY + 'material = "vhb-4910"\n[frame]\nshape = "drawn"\n'
             '[[frame.segments]]\nkind = "arc"\ncentre = ["0 mm", "0 mm"]\n'
             'radii = ["45 mm", "45 mm"]\nstart = "0 deg"\nsweep = "180 deg"\n'
             '[[frame.segments]]\nkind = "line"\nstart = ["-45 mm", "0 mm"]\n'
             'end = ["45 mm", "0 mm"]\n',
}
RIG = ('gravity = "9.81 m/s^2"\nspring = "5 N/m"\nsag_voltage = "20 kV"\nsensor_gain = 0.1\n'
       'drift = "1 um/min"\nguide = "free"\nweight_offset = ["1 mm", "0 mm"]\n'
       'plate_pressure = "1 Pa"\nfriction = "1 mN"\nplate_damping = "1 N s/m"\n'
       'added_mass = "1 g"\nseries_resistance = "1 MOhm"\nleakage_resistance = "1 GOhm"\n'
       'sensor_lag = "5 ms"\n')
STUDY = ('name = "study"\nspecimens = ["oval.toml"]\nmass = "17.9 g"\nvoltage = "1 kV"\n'
         '[curves]\nmass = ["17.9 g"]\nvoltage = ["0 kV", "3 kV"]\n[rig]\nspring = "5 N/m"\n')
SWEEP = ('specimen = ["oval.toml"]\nmass = ["17.9 g", "20 g"]\n'
         'voltage = { from = "0 kV", to = "7 kV", count = 15 }\n'
         '[grid]\n"plate.radius" = ["1 cm", "12 mm"]\n"frame.semi_axes" = [["6 cm", "45 mm"]]\n'
         '[list]\n"rig.spring" = ["1 N/m", "2 N/m"]\n'
         '[sample]\nmethod = "sobol"\ncount = 4\nseed = 1\n'
         '[sample.ranges]\n"membrane.thickness" = ["0.5 mm", "1 mm"]\n')
OPTIMISE = ('specimen = "oval.toml"\nmass = "17.9 g"\nvoltage = "3 kV"\nhold = ["area"]\n'
            '[vary]\n"frame.semi_axes.0" = ["5 cm", "9 cm"]\n'
            '[[start]]\n"frame.semi_axes.0" = "7 cm"\n')
DATASET = ('name = "data"\nnoise = "20 um"\n[rig]\ngravity = "9.81 m/s^2"\n[[specimen]]\n'
           + OVAL.replace("[", "[specimen.") .replace("[specimen.2", "[2")
           .replace('= [specimen."', '= ["') + 'material = "vhb-4910"\n')
STATIC = ("specimen,mass_g,voltage_kV,displacement_mm,order,direction,elapsed_s\n"
          + "".join(f"oval,17.9,{volts},{2 + 0.1 * volts:.2f},{volts},up,{60 * volts}\n"
                    for volts in range(6)))
RANGE = "specimen,mass_g,voltage_min_kV,voltage_max_kV,range_mm\noval,17.9,0,5,0.4\n"
TRANSIENT = ("specimen,mass_g,run,t_s,voltage_kV,displacement_mm\n"
             + "".join(f"oval,17.9,a,{0.1 * n:.1f},{3 * (n > 2)},2.{n}\n" for n in range(6)))
COUPON = "mode,stretch,nominal_stress_kPa\nuniaxial,1.5,20\nequibiaxial,2,30\n"
SIGNAL = "t_s,voltage_kV\n0,0\n0.5,1\n1,0.2\n"

#: What a number, a text or a line may become.
VALUES = (
    "0", "-1", "-0.0", "1e300", "-1e300", "1e-300", "1e999", "nan", "inf", "-inf", "1" * 5000,
    "9" * 30, "true", "[]", "{}", '""', '" "', '"x"', "[[[1]]]", "[" * 500, "1979-05-27", "0x10",
    '"1e300 mm"', '"-1 mm"', '"0 mm"', '"inf kV"', '"nan mm"', '"1 mm**9**9**9"', '"9**9**9 mm"',
    '"1 (mm"', '"1 kg/(m s^2)"', '"1 m^-9"', '"1 µm"', '"1 °"', '"1 degC"', '"1 dB"', '"1 V"',
    '"\\u0000"', '"../oval.toml"', '"/"', '"oval.toml"', '"a\\nb"', '"\\ud7ff"', "[plate]",
    "[a.b.c]", "[[frame]]", "a = 1", "a.b.c.d = 1", "#", ",", ";", '"', "'", "\x00", "\ufeff", "é",
    "999", "-7", "1e20", "1e10", "1e-20", "3",
)


@dataclass(frozen=True)
class Kind:
    """A file by name, contents that can be read, and how it is read in its folder.

    ``seconds`` of processor time are enough: loads that are left out follow from the film, which
    is then solved.
    """

    file: str
    contents: tuple[bytes, ...]
    read: Callable[[Path], object]
    seconds: float = 2.0


def _dxf() -> bytes:
    """A drawing of a line, an arc, a polyline with a bulge, an ellipse and a spline."""
    document = ezdxf.new(units=ezdxf.units.MM)
    space = document.modelspace()
    space.add_line((0, 0), (50, 0))
    space.add_arc((0, 0), 50, 0, 90)
    space.add_lwpolyline([(0, 50, 0.3), (-5, 20, 0), (0, 0, 0)], format="xyb")
    space.add_ellipse((0, 0), (30, 0), 0.5, dxfattribs={"layer": "other"})
    space.add_spline([(0, 0), (9, 4), (20, 3), (30, 0)], dxfattribs={"layer": "third"})
    with tempfile.TemporaryDirectory() as folder:
        document.saveas(Path(folder) / "a.dxf")
        text = (Path(folder) / "a.dxf").read_bytes()
    # Its head and its objects say nothing of the curves.
    place = text.index(b"  2\nENTITIES")
    return b"  0\nSECTION\n" + text[place: text.index(b"ENDSEC", place)] + b"ENDSEC\n  0\nEOF\n"


def _drawing(folder: Path) -> None:
    table = Table(folder / "specimen.toml", {"shape": "dxf", "file": "a.dxf"}, "frame")
    check_outline(OUTLINES.read(table), "frame")


def _dataset(folder: Path) -> None:
    summary(read_dataset(folder))


def kinds() -> dict[str, Kind]:
    """What is read, by name."""
    def texts(*parts: str) -> tuple[bytes, ...]:
        return tuple(part.encode() for part in parts)

    return {
        "specimen": Kind("specimen.toml", texts(*SPECIMENS.values()),
                         lambda folder: load_specimen(folder / "specimen.toml")),
        "rig": Kind("rig.toml", texts(RIG), lambda folder: Rig.read(folder / "rig.toml")),
        "study": Kind("STUDY.toml", texts(STUDY), lambda folder: read_study(folder / "STUDY.toml"),
                      30.0),
        "sweep": Kind("SWEEP.toml", texts(SWEEP), lambda folder: read_sweep(folder / "SWEEP.toml")),
        "optimise": Kind("OPTIMISE.toml", texts(OPTIMISE),
                         lambda folder: read_problem(folder / "OPTIMISE.toml"), 30.0),
        "dataset": Kind("dataset.toml", texts(DATASET), _dataset),
        **{name: Kind(f"{name}.csv", texts(content), _dataset) for name, content in (
            ("static", STATIC), ("range", RANGE), ("transient", TRANSIENT), ("coupon", COUPON))},
        "signal": Kind("signal.csv", texts(SIGNAL), lambda folder: read_signal(
            folder / "signal.csv")),
        "drawing": Kind("a.dxf", (_dxf(),), _drawing),
    }


KINDS = kinds()
#: Quoted texts, numbers and words.
_TOKEN = re.compile(rb'"[^"\n]*"|[-+.\w]+')


@st.composite
def inputs(draw: st.DrawFn) -> tuple[str, bytes]:
    """The name of a kind and a content that was changed in a few places."""
    name = draw(st.sampled_from(sorted(KINDS)))
    content = draw(st.sampled_from(KINDS[name].contents))
    for _ in range(draw(st.integers(1, 3))):
        content = _changed(draw, content)
    return name, content


def _changed(draw: st.DrawFn, content: bytes) -> bytes:
    tokens = list(_TOKEN.finditer(content))
    lines = content.split(b"\n")
    way = draw(st.sampled_from(("value", "value", "value", "swap", "drop", "repeat", "bytes",
                                "cut")))
    if way in ("value", "swap") and tokens:
        first, second = sorted((draw(st.sampled_from(tokens)) for _ in range(2)),
                               key=lambda token: token.start())
        if way == "swap" and first.end() <= second.start():
            return (content[:first.start()] + second.group()
                    + content[first.end():second.start()] + first.group() + content[second.end():])
        value = draw(st.sampled_from(VALUES) | st.floats().map(repr) | st.text(max_size=5))
        return (content[:first.start()] + value.encode("utf-8", "surrogatepass")
                + content[first.end():])
    place = draw(st.integers(0, len(lines) - 1))
    if way == "drop":
        return b"\n".join(lines[:place] + lines[place + 1:])
    if way == "repeat":
        times = draw(st.sampled_from((1, 1, 2, 300)))
        return b"\n".join(lines[:place] + times * [lines[place]] + lines[place:])
    at = draw(st.integers(0, len(content)))
    return content[:at] if way == "cut" else content[:at] + draw(st.binary(max_size=4)) + content[
        at:]


class Hang(BaseException):
    """Reading took too long; no library takes it for one of its own errors."""


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """At most so much processor time."""
    def end(*_: Any) -> None:
        raise Hang(f"more than {seconds} s of processor time")

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@cache
def _import_libraries() -> None:
    """What a first reading imports is no part of its time."""
    from tympan.geometry.cad import parts
    from tympan.geometry.outlines import dxf

    assert parts
    assert dxf
    with tempfile.TemporaryDirectory() as scratch:
        _read("optimise", KINDS["optimise"].contents[0], Path(scratch))


def survive(name: str, content: bytes) -> None:
    """Read a content as its kind; drawings in this process, which shows what they raise."""
    _import_libraries()
    with (tempfile.TemporaryDirectory() as scratch, _limited(KINDS[name].seconds),
          suppress(InputError)):
        _read(name, content, Path(scratch))


def _read(name: str, content: bytes, folder: Path) -> None:
    kind = KINDS[name]
    apart, drawings.read_apart = drawings.read_apart, drawings.record
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for file, text in (("oval.toml", SPECIMENS["oval"]), ("dataset.toml", DATASET),
                               ("static.csv", STATIC)):
                (folder / file).write_text(text, encoding="utf-8")
            (folder / kind.file).write_bytes(content)
            kind.read(folder)
    finally:
        drawings.read_apart = apart


def batch(number: int, folder: Path) -> None:
    """Read examples of a seed, each of which is kept in a folder until the next one."""
    count = 0

    @seed(number)
    @settings(max_examples=_BATCH, database=None, deadline=None,
              suppress_health_check=list(HealthCheck))
    @given(inputs())
    def reading(item: tuple[str, bytes]) -> None:
        nonlocal count
        name, content = item
        (folder / "last").write_bytes(name.encode() + b"\n" + content)
        survive(name, content)
        count += 1

    try:
        reading()
    finally:
        print(count)


def main() -> int:
    """Batches until the time is over; 1 where there was a find."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=None, help="of the first batch")
    parser.add_argument("--batch", type=Path, metavar="DIR", help="one batch alone")
    options = parser.parse_args()
    first = secrets.randbelow(10**6) if options.seed is None else options.seed
    if options.batch is not None:
        batch(first, options.batch)
        return 0
    ends, number, count, finds = time.monotonic() + 60 * options.minutes, first, 0, 0
    with tempfile.TemporaryDirectory() as scratch:
        while number == first or time.monotonic() < ends:
            command = [sys.executable, "-m", "benchmarks.trials.fuzz", "--batch", scratch,
                       "--seed", str(number)]
            try:
                done = subprocess.run(command, capture_output=True, text=True, check=False,
                                      timeout=_PATIENCE)
                said, ended = done.stdout + done.stderr[-4000:], done.returncode
                count += int(done.stdout.split()[-1]) if done.stdout.split() else 0
            except subprocess.TimeoutExpired:
                said, ended = f"no end within {_PATIENCE} s", 1
            if ended:
                finds += 1
                read = [file.read_bytes()[:4000] for file in Path(scratch).glob("last")]
                print(f"seed {number} ended with {ended}\n{said}\nlast read: {read}", flush=True)
            number += 1
    print(f"{count} files read, seeds {first} to {number - 1}: {finds} finds")
    return int(finds > 0)


if __name__ == "__main__":
    sys.exit(main())
