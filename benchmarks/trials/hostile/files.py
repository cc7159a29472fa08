"""Numbers, tables and readings."""

from __future__ import annotations

import re

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import (
    COUPON,
    GOOD,
    LOADS,
    SAMPLE,
    SOLVE,
    STATIC,
    TRANSIENT,
    of_coupon,
    of_dataset,
    of_specimen,
    of_sweep,
)

TEN = str([f"{size} mm" for size in range(1, 11)])


@group("unit")
def unit() -> Cases:
    for value in ("1 mm**9**9**9", "9**9**9**9 mm", "1 mm.__class__"):
        yield of_specimen(value, '"1 cm"', f'"{value}"', "plate.radius.*unknown unit")


@group("toml")
def toml() -> Cases:
    yield of_specimen("5000 digits", "= 4.7", f"= {'1' * 5000}", "too many digits")
    yield of_specimen("1000 nested tables", "[plate]", f"[plate{'.plate' * 1000}]", "nested")
    loads = LOADS.replace("specimen.toml", "a\\u0000b.toml")
    listed = re.sub("specimen = (.*)", r'name = "s"\nspecimens = [\1]', loads)
    nul = "no file has NUL in its name"
    yield Case("NUL in a study", "study STUDY.toml -o out", {"STUDY.toml": listed}, nul)
    yield Case("NUL in a sweep", "sweep SWEEP.toml -o out", {"SWEEP.toml": loads}, nul)


@group("numbers")
def numbers() -> Cases:
    yield Case("elapsed inf", f"{SOLVE} --elapsed 'inf s'", GOOD, "--elapsed")
    study = LOADS.replace("1 kV", "1e300 V").replace("specimen = ", 'name = "s"\nspecimens = [')
    yield Case("study at 1e300 V", "study STUDY.toml -o out", {
        **GOOD, "STUDY.toml": study.replace('.toml"', '.toml"]', 1)}, "STUDY.toml.*voltage")
    yield Case("drift 1e300 m/s", f"{SOLVE} --rig rig.toml --elapsed '1 s'", {
        **GOOD, "rig.toml": 'drift = "1e300 m/s"\n'}, "rig.toml: drift")


@group("cases")
def cases() -> Cases:
    for count, many in ((10, TEN), (40, "[1, 2]")):
        grid = "\n".join(f'"k{key}" = {many}' for key in range(count))
        yield of_sweep(f"grid of {count} keys", f"{LOADS}[grid]\n{grid}",
                       "grid.*at most 1000000 specimens")
    keys = "\n".join(f'"k{key}" = [1, 2]' for key in range(21_202))
    yield of_sweep("21202 keys", LOADS + SAMPLE + keys, "at most 1000 keys")
    yield of_sweep("bound of 400 digits", f'{LOADS}{SAMPLE}"k" = [1, 1{"0" * 400}]', "64 bits")


@group("no file")
def no_file() -> Cases:
    yield Case("pipe", SOLVE, {"specimen.toml": None}, "specimen.toml: cannot be read")
    yield of_dataset("pipe as table", "data data", "static.csv: cannot be read", static=None)
    yield Case("/dev/zero", "solve /dev/zero --mass '1 g'", {}, "cannot be read")


@group("readings")
def readings() -> Cases:
    massless = "\n".join(line.replace("17.9", "0") for line in STATIC.splitlines())
    yield of_dataset("no mass", "diagnose data -o out", "must be above 0", static=massless)
    identify = "lumped identify data --dynamic -o out"
    for time_s in ("1e300", "1e-300"):
        lines = TRANSIENT.splitlines()
        table = "\n".join([*lines[:2], lines[2].replace("0.1", time_s, 1)])
        yield of_dataset(f"{time_s} s", identify, "transient.csv: line 3", transient=table)
    yield of_dataset("1e300 mm", identify, "transient.csv: line 2",
                     transient=TRANSIENT.replace("2.0", "1e300"))
    yield of_coupon("1e300 kPa", "coupon.csv: line 2", COUPON.replace("1.5,20", "1.5,1e300"))
    yield of_coupon("stretch 1e10", "coupon.csv: line 2", COUPON.replace("1.5,20", "1e10,20"))
