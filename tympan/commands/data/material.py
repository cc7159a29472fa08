"""``tympan material``: look at a law, or fit one to coupon tests."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tympan.options import (
    Subcommands,
    command,
    command_group,
    json_argument,
    output_argument,
    parse_quantity,
    print_json,
)

if TYPE_CHECKING:
    from tympan.studies.material.fit import Comparison, LawFit


def add(commands: Subcommands) -> None:
    """The command and its two subcommands."""
    kinds = command_group(commands, "material", "look at a material, or fit one to coupon tests")
    _show(kinds)
    _fit(kinds)


def _show(kinds: Subcommands) -> None:
    parser = command(kinds, "show", _run_show,
                     "true stress against stretch, and where the law fails")
    parser.add_argument("material", metavar="NAME|SPECIMEN.toml",
                        help="of the library, also a refused one; or the material of a specimen "
                             "file")
    parser.add_argument("--held", type=float, metavar="X",
                        help="stretch held across in the second column (default: as mounted, "
                             "else 1)")
    json_argument(parser)


def _run_show(options: argparse.Namespace) -> None:
    from tympan.fem.film.law_report import examine, subject

    shown = examine(*subject(options.material, options.held))
    if options.json:
        print_json(shown.json())
        return
    print(shown)


def _fit(kinds: Subcommands) -> None:
    parser = command(kinds, "fit", _run_fit,
                     "fit laws to uniaxial, equibiaxial and pure-shear tests")
    parser.add_argument("coupons", type=Path, metavar="COUPON.csv",
                        help="columns mode, stretch, nominal_stress_kPa; also specimen, t_s, run")
    parser.add_argument("--law", action="append", metavar="NAME",
                        help="may be given several times; all (default) compares every law")
    parser.add_argument("--noise", metavar="STRESS",
                        help='standard deviation of one reading, such as "2 kPa"; '
                             "without it, estimated from the residuals")
    output_argument(parser, "also store the fits (JSON), their curves (CSV), a figure, and the "
                            "best law for specimen files (TOML)")
    json_argument(parser)


def _run_fit(options: argparse.Namespace) -> None:
    from tympan.geometry.errors import InputError
    from tympan.studies.data.coupon import read_coupons
    from tympan.studies.material.fit import FitSettings, compare
    from tympan.studies.material.result import MaterialFitResult, material_fit_result

    noise = None if options.noise is None else parse_quantity(options.noise, "stress", "--noise")
    if noise is not None and not 0 < noise < float("inf"):
        raise InputError("must be positive", key="--noise", given=options.noise)
    names = None if not options.law or "all" in options.law else options.law
    coupons = read_coupons(options.coupons)
    try:
        comparison = compare(coupons, names, FitSettings(noise))
    except InputError as error:
        raise error.located(file=options.coupons) from None
    result = material_fit_result(comparison, options.coupons)
    if options.output is not None:
        from tympan.reports.figures.coupon import draw_fit

        result.save(options.output)
        draw_fit(MaterialFitResult.load(options.output), options.output)
    if options.json:
        print_json(result.json())
    else:
        _show_fits(comparison, result.json())


def _show_fits(comparison: Comparison, result: dict[str, Any]) -> None:
    counts = ", ".join(f"{count} {mode.replace('_', ' ')}"
                       for mode, count in result["readings"].items())
    print(f"{counts} readings; lowest criterion first, misfit in kPa; limits are 95 %")
    for fit in comparison.fits:
        print(f"{fit.family.name:<14} AICc {fit.criterion:9.2f}  misfit {fit.rmse / 1e3:8.4g}"
              f"{'' if fit.offered else '  not offered'}")
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
