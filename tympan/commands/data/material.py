"""``tympan material``: look at a law, or fit one to coupon tests."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tympan.geometry.errors import InputError
from tympan.options import JSON, argument, command, finish, output, parse_quantity, print_json

if TYPE_CHECKING:
    from tympan.studies.material.fit import Comparison, LawFit


@command("material show",
         argument("material", metavar="NAME|SPECIMEN.toml",
                  help="of the library, also a refused one; or the material of a specimen file"),
         argument("--held", type=float, metavar="X",
                  help="stretch held across in the second column (default: as mounted, else 1)"),
         JSON)
def show_material(options: argparse.Namespace) -> None:
    """True stress against stretch, and where the law fails."""
    from tympan.fem.film.law_report import examine, subject

    shown = examine(*subject(options.material, options.held))
    if options.json:
        print_json(shown.json())
        return
    print(shown)


@command("material fit",
         argument("coupons", type=Path, metavar="COUPON.csv",
                  help="columns mode, stretch, nominal_stress_kPa; also specimen, t_s, run"),
         argument("--law", action="append", metavar="NAME",
                  help="may be given several times; all (default) compares every law"),
         argument("--noise", metavar="STRESS",
                  help='standard deviation of one reading, such as "2 kPa"; without it, estimated '
                       "from the residuals"),
         output("also store the fits (JSON), their curves (CSV), a figure, and the best law for "
                "specimen files (TOML)"), JSON)
def fit_material(options: argparse.Namespace) -> None:
    """Fit laws to uniaxial, equibiaxial and pure-shear tests."""
    from tympan.studies.data.coupon import read_coupons
    from tympan.studies.material.fit import compare
    from tympan.studies.material.result import material_fit_result

    noise = None if options.noise is None else parse_quantity(options.noise, "stress", "--noise")
    if noise is not None and not 0 < noise < float("inf"):
        raise InputError("must be positive", key="--noise", given=options.noise)
    names = None if not options.law or "all" in options.law else options.law
    coupons = read_coupons(options.coupons)
    try:
        comparison = compare(coupons, names, noise)
    except InputError as error:
        raise error.located(file=options.coupons) from None
    finish(options, material_fit_result(comparison, options.coupons),
           partial(_show_fits, comparison))


def _show_fits(comparison: Comparison, result: dict[str, Any]) -> None:
    counts = ", ".join(f"{count} {mode.replace('_', ' ')}"
                       for mode, count in result["readings"].items())
    print(f"{counts} readings; lowest criterion first, misfit in kPa; limits are 95 %")
    for fit in comparison.fits:
        print(f"{fit.family.name:<14} AICc {fit.criterion:9.2f}  misfit "
              f"{fit.rmse / 1e3:8.4g}{'' if fit.offered else '  not offered'}")
        for line in _constants(fit):
            print(f"    {line}")
        for note in fit.notes:
            print(f"    note: {note}")
    for warning in comparison.warnings:
        if comparison.best is None or not warning.startswith(f"{comparison.best.family.name}: "):
            print(f"warning: {warning}")
    if result["material_toml"]:
        print(f"\n{result['material_toml']}", end="")


def _constants(fit: LawFit) -> list[str]:
    """One line per constant with its limits."""
    lines = []
    for index, (name, value, limits) in enumerate(zip(fit.family.constants, fit.values, fit.limits,
                                                      strict=True)):
        unit, size = (" kPa", 1e3) if index < len(fit.family.linear) else ("", 1.0)
        low, high = ("none" if limit is None else f"{limit / size:.4g}" for limit in limits)
        lines.append(f"{name} = {value / size:.5g}{unit}  ({low} to {high})")
    return lines
