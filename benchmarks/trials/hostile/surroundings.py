"""Terminals, folders, options and signals."""

from __future__ import annotations

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import (
    COUPON,
    GOOD,
    LOADS,
    SOLVE,
    STATIC,
    of_coupon,
    of_dataset,
)

TESTS = COUPON + "uniaxial,2,30\nuniaxial,3,40\nequibiaxial,3,60\n"


@group("ascii")
def ascii_only() -> Cases:
    plain = {"LC_ALL": "C", "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    for command in ("--help", "alpha --help", "materials", SOLVE):
        yield Case(command, command, GOOD, status=0, environment=plain)


@group("other files")
def other_files() -> Cases:
    yield Case("a file of the user", "material fit coupon.csv -o .", {
        "coupon.csv": TESTS, "material.toml": "mine = 1\n"}, "material.toml")


@group("options")
def options() -> Cases:
    yield Case("empty address", "sweep SWEEP.toml -o out --scheduler ''", {
        **GOOD, "SWEEP.toml": LOADS}, "--scheduler")
    yield of_dataset("seed -1", "diagnose data -o out --seed -1", "--seed", static=STATIC)
    yield Case("999999 workers", "map -o out --workers 999999", {}, "--workers")
    for noise in ("1e-300 kPa", "1e300 kPa"):
        yield of_coupon(f"noise {noise}", "--noise", COUPON, f"--noise '{noise}'")
    yield Case("guide along mass", "path specimen.toml --along mass --mass '20 g' --rig rig.toml", {
        **GOOD, "rig.toml": 'guide = "fixed"\n'}, "guide")


@group("signals of voltage")
def signals_of_voltage() -> Cases:
    simulate = "lumped simulate specimen.toml --mass '20 g' --signal signal.csv -o out"
    for step_s, status in ((1.0, 2), (0.001, 0)):
        rows = "".join(f"{row * step_s},{row % 3}\n" for row in range(200_000))
        yield Case(f"200000 samples of {step_s} s", simulate, {
            **GOOD, "signal.csv": "t_s,voltage_kV\n" + rows},
            "1000000 samples" if status else "", status)
    yield Case("1e-12 g", "lumped simulate specimen.toml --mass '1e-12 g' -o out", GOOD, "mass")
