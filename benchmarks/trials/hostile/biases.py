"""Mechanisms between plate and ground that cannot be, and a plate that goes beyond one."""

from __future__ import annotations

import re

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import GOOD, SOLVE, SPECIMEN

_HEAD = "displacement_mm,force_N\n"


def _with_rig(name: str, rig: str, words: str, status: int = 2, load: str = SOLVE,
              **files: str) -> Case:
    """A solve on a rig with one mechanism, and the files that it names."""
    return Case(name, f"{load} --rig rig.toml",
                GOOD | {"rig.toml": f"[[bias]]\n{rig}"} | {
                    file.replace("_", "."): content for file, content in files.items()},
                words, status)


def _of_table(name: str, content: str, words: str, columns: str = "") -> Case:
    """A solve on a rig whose mechanism is in a file of this content."""
    return _with_rig(name, f'law = "table"\nfile = "beam.csv"\n{columns}', words,
                     beam_csv=content)


@group("tables of forces")
def tables_of_forces() -> Cases:
    yield _of_table("two forces", _HEAD + "0,0\n1,0.1\n1,0.2\n", "line 4, .*'1': .* one run")
    yield _of_table("out and back", _HEAD + "0,0\n1,0.1\n0.5,0\n", "line 4, .*'0.5': .* one run")
    yield _of_table("wrong sign", _HEAD + "-2,0.1\n1,0.02\n4,-0.1\n",
                    "must be positive where .* Change the sign of a spring")
    yield _of_table("one row", _HEAD + "0,0\n", "from 2 to 10000 rows")
    yield _of_table("no rows", _HEAD, "no readings below")
    yield _of_table("empty", "", "is empty")
    yield _of_table("no force", "displacement_mm\n0\n1\n", "column force_N is missing")
    yield _of_table("unknown unit", "displacement_mm,force_foo\n0,0\n1,1\n", "unknown unit")
    yield _of_table("wrong unit", "displacement_mm,force_mm\n0,0\n1,1\n", "wrong dimension")
    yield _of_table("no number", _HEAD + "0,0\n1,much\n", "line 3, .*'much': must be a number")
    yield _of_table("other columns", "travel_mm,push_N\n0,0\n1,1\n", "push_mN is missing",
                    'columns = ["travel_mm", "push_mN"]\n')
    yield _of_table("three columns", _HEAD + "0,0\n1,1\n", "columns: .* two names",
                    'columns = ["a_mm", "b_N", "c_s"]\n')
    yield _with_rig("no file", 'law = "table"\nfile = "beam.csv"\n', "beam.csv: cannot be read")
    yield _with_rig("a number for a file", 'law = "table"\nfile = 3\n', "file: .* string")
    yield _with_rig("neither", 'law = "table"\n', "displacement: is missing")
    yield Case("beyond the table", f"{SOLVE.replace('1 g', '20 g')} --rig rig.toml", GOOD | {
        "rig.toml": '[[bias]]\nlaw = "table"\nfile = "beam.csv"\n',
        "beam.csv": _HEAD + "0,0\n0.01,0.001\n"},
        status=0, shows='status +not_converged(.|\\n)*"table" of the rig ends .* extrapolated')


def _of_film(name: str, words: str, keys: str, head: str = 'specimen = "specimen.toml"',
             load: str = SOLVE, **files: str) -> Case:
    """A solve on a rig with another film, the same one unless it is said otherwise."""
    return _with_rig(name, f'law = "film"\n{head}\n{keys}\n', words, load=load, **files)


@group("joined films")
def joined_films() -> Cases:
    both = 'distance = "20 mm"\nrod = "20 mm"'
    yield _of_film("rod too short", "rod: given '10 mm': must be from .* half extent",
                   'distance = "1 m"\nrod = "10 mm"')
    yield _of_film("rod too long", "rod: .* half extent", 'distance = "0 mm"\nrod = "1 m"')
    yield _of_film("no rod", "rod: is missing", 'distance = "20 mm"')
    yield _of_film("rod without unit", "rod: .* has no unit", 'distance = "20 mm"\nrod = 20')
    yield _of_film("negative voltage", "voltage: .* negative", f'{both}\nvoltage = "-1 kV"')
    yield _of_film("other side", "side: .* must be one of", f'{both}\nside = "left"')
    yield _of_film("no specimen file", "other.toml: cannot be read", both,
                   'specimen = "other.toml"')
    yield _of_film("no specimen", "specimen: is missing", both, "")
    yield _of_film("a number", "specimen: .* must be a table", both, "specimen = 3")
    yield _of_film("no plate", "plate", both, 'specimen = "other.toml"',
                   other_toml=re.sub(r"(?s)\[plate\].*?(?=\n\[)", "", SPECIMEN))
    yield _of_film("too much voltage", "voltage: given '900 kV': .* other film bears",
                   f'{both}\nvoltage = "900 kV"')
