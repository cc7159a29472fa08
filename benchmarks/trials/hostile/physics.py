"""Numbers and sentences that were once wrong, each against a value found independently."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

from benchmarks.trials.hostile.case import Case, Cases, group

_ROUND = """name = "{name}"
[frame]
shape = "circle"
radius = "31.7 mm"
[plate]
shape = "circle"
radius = "7.3 mm"
"""
_FILM = """[membrane]
thickness = "{thickness}"
prestretch = [{stretch}, {stretch}]
relative_permittivity = 3.1
"""
_B3 = (_ROUND.format(name="b3") + _FILM.format(thickness="0.41 mm", stretch=1.51)
       + '[membrane.material]\nlaw = "mooney_rivlin"\nc10 = "11.3 kPa"\nc01 = "0.7 kPa"\n')
_YEOH = (_ROUND.format(name="yeoh") + _FILM.format(thickness="0.83 mm", stretch=1.93)
         + 'permittivity_exponent = -0.6\n[membrane.material]\nlaw = "yeoh"\n'
         'c = ["13.1 kPa", "-0.21 kPa", "0.0093 kPa"]\n')
_BARE = (_ROUND.format(name="w3") + _FILM.format(thickness="0.61 mm", stretch=1.09)
         + '[membrane.material]\nlaw = "neo_hooke"\nmu = "23 kPa"\n'
         '[electrode]\nmargin_frame = "11.3 mm"\nmargin_plate = "2.9 mm"\n')
#: A drum without weight: 21.3 kPa neo-Hooke, 0.83 mm stretched to 2.03 each way.
_DRUM = ('name = "drum"\n[frame]\nshape = "circle"\nradius = "31.7 mm"\n'
         + _FILM.format(thickness="0.83 mm", stretch=2.03)
         + '[membrane.material]\nlaw = "neo_hooke"\nmu = "21.3 kPa"\n')
_EL = """name = "el"
[frame]
shape = "ellipse"
semi_axes = ["53.9 mm", "37.3 mm"]
[plate]
shape = "circle"
radius = "8.3 mm"
""" + _FILM.format(thickness="0.83 mm", stretch=2.03) + """[membrane.material]
law = "gent"
mu = "31.7 kPa"
j_lim = 47.3
"""
_REQUIREMENTS = """specimen = "el.toml"
mass = "31.3 g"
voltage = "7.9 kV"
tolerances = "none"
[want]
stroke = "largest"
frame_perimeter = "289 mm"
max_true_stress = "131 kPa"
gap = "12 mm"
[vary]
"frame.semi_axes.0" = ["38 mm", "66 mm"]
"frame.semi_axes.1" = ["29 mm", "60 mm"]
"plate.radius" = ["3.7 mm", "19 mm"]
"""
_UNEQUAL = """name = "unequal"
[frame]
shape = "ellipse"
semi_axes = ["{}", "{}"]
[plate]
shape = "circle"
radius = "9 mm"
offset = ["{}", "{}"]
[membrane]
thickness = "0.5 mm"
prestretch = [{}, {}]
relative_permittivity = 3.1
[membrane.material]
law = "neo_hooke"
mu = "21 kPa"
"""
_SOLVE = "solve b3.toml --mass '3 g' --voltage '2.7 kV' --json"


def _between(file: str, read: Callable[[Path], float], low: float, high: float
             ) -> Callable[[Path], str]:
    """A check that a number of a result lies between two."""
    def check(folder: Path) -> str:
        value = read(folder / file)
        return "" if low <= value <= high else f"{value:.6g}"

    return check


def _first(column: str) -> Callable[[Path], float]:
    """Reads the first number of a column."""
    def read(file: Path) -> float:
        with file.open(encoding="utf-8") as lines:
            return float(next(csv.DictReader(lines))[column])

    return read


def _same_pull_in(folder: Path) -> str:
    """What is wrong with the limits of a film and of the same with its axes swapped."""
    here, swapped = (json.loads((folder / name / f"{name}-curve.json").read_text())
                     ["curves"][0]["limits"]["pull_in"] for name in ("a", "b"))
    error = abs(here["voltage_V"] / swapped["voltage_V"] - 1)
    return "" if error <= here["spread"] + swapped["spread"] else f"{error:.1e} apart"


@group("physics")
def physics() -> Cases:
    """Signs, reactions, limits: by an independent solver, a balance, or a closed form."""
    files: dict[str, str | bytes | None] = {"b3.toml": _B3}
    yield Case("gas lifts", f"{_SOLVE} --pressure '37 Pa'", files, status=0,
               shows=r'"deflection_m": -0\.00022[45]')
    yield Case("suction adds to the weight", f"{_SOLVE} --pressure='-37 Pa'", files, status=0,
               shows=r'"deflection_m": 0\.00182[78]')
    # The drum's height is that of a soap film: pressure times radius squared over four tensions.
    yield Case("gas lifts a drum", "solve drum.toml --pressure '1 Pa' --json",
               {"drum.toml": _DRUM}, status=0, shows=r'"deflection_m": -1\.4[34]\d*e-05')
    # Weight and the plate's pressure alone: 3 g and 37 Pa on a disk of 7.3 mm.
    for refine in (1, 2, 4):
        yield Case(f"reaction, refine {refine}",
                   f"{_SOLVE} --pressure='-37 Pa' --refine {refine}", files, status=0,
                   shows=r'"reaction_N": 0\.035614')
    yield Case("stress without voltage", "design WANTED.toml --json",
               {"WANTED.toml": _REQUIREMENTS, "el.toml": _EL}, status=0, shows='"impossible"')
    # By the axisymmetric equations the film gives way in itself at 5240.16 V.
    film: dict[str, str | bytes | None] = {"yeoh.toml": _YEOH}
    for refine in (1, 1.5, 2):
        yield Case(f"instability, refine {refine}",
                   f"limits yeoh.toml --mass '58 g' --refine {refine} --json", film, status=0,
                   shows=r'"instability": {"kind": "instability", "voltage_V": 52(39|40)\.',
                   never='"voltage_V": 5[67]|Traceback')
    yield Case("solve beyond it", "solve yeoh.toml --mass '58 g' --voltage '5.65 kV'", film,
               status=0, shows="instability at.*this equilibrium is unstable")
    yield Case("curve beyond it", "curve yeoh.toml --mass '58 g' -o a", film, status=0,
               check=_between("a/yeoh-curve.csv", _first("voltage_kV"), 0.0, 0.0))
    yield Case("sentence and numbers", "limits w3.toml --mass '20 g'", {"w3.toml": _BARE},
               status=0, shows=r"loss of tension +(9\.\d+ kV) .*\(the limit\)(.|\n)*"
               r"loss of tension at \1 ")
    axes = ("61.3 mm", "38.7 mm"), ("5.9 mm", "-3.1 mm"), (1.37, 2.91)
    both: dict[str, str | bytes | None] = {
        f"{name}.toml": _UNEQUAL.format(*(entry for pair in axes for entry in pair[::step]))
        .replace('"unequal"', f'"{name}"') for name, step in (("a", 1), ("b", -1))}
    script = ("from tympan.cli import main\nfor name in 'ab':\n    main(['curve', f'{name}.toml', "
              "'--mass', '5 g', '--beyond', '-o', name])\n")
    yield Case("swapped axes", "a.py", {**both, "a.py": script}, status=0, program=(),
               seconds=60.0, check=_same_pull_in)
    yield Case("current of a step", "transient b3.toml --mass '3 g' --signal step --high '2 kV' "
               "--duration '10 ms' -o a", files, status=0, seconds=60.0,
               check=_between("a/transient.csv", _first("film_voltage_kV"), 0.0, 0.0))
