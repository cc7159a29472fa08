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
    from tympan.studies.material.fit import Comparison, Fit


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
    output_argument(parser, "also store the fits (JSON), a figure, and the best law for specimen "
                            "files (TOML)")
    json_argument(parser)


def _run_fit(options: argparse.Namespace) -> None:
    from tympan.geometry.errors import InputError
    from tympan.studies.data.coupon import read_coupons
    from tympan.studies.material.fit import FitSettings, compare

    noise = None if options.noise is None else parse_quantity(options.noise, "stress", "--noise")
    if noise is not None and not 0 < noise < float("inf"):
        raise InputError("must be positive", key="--noise", given=options.noise)
    names = None if not options.law or "all" in options.law else options.law
    coupons = read_coupons(options.coupons)
    try:
        comparison = compare(coupons, names, FitSettings(noise))
    except InputError as error:
        raise error.located(file=options.coupons) from None
    result = _result(options.coupons, comparison)
    if options.output is not None:
        _store(options.output, comparison, result)
    if options.json:
        print_json(result)
    else:
        _print(comparison, result)


def _result(file: Path, comparison: Comparison) -> dict[str, Any]:
    """The numbers of ``--json``."""
    from tympan.studies.material.fit import material_lines

    coupons, best = comparison.coupons, comparison.best
    counts = {mode: int((coupons.mode == mode).sum()) for mode in coupons.modes}
    text = material_lines(best.material,
                          best.range) if best is not None and best.material is not None else None
    return {"file": str(file), "readings": counts,
            "best": None if best is None else best.family.name,
            "material_toml": text, "noise_Pa": (best or comparison.fits[0]).noise.sigma,
            "fits": [fit.json() for fit in comparison.fits], "warnings": comparison.warnings}


def _store(folder: Path, comparison: Comparison, result: dict[str, Any]) -> None:
    from tympan.reports.figures.coupon import draw_fit
    from tympan.studies import files as store

    store.remove(folder, "material.toml")
    store.write_json(folder / "fit.json", result)
    if result["material_toml"]:
        store.write_text(folder / "material.toml", result["material_toml"])
    draw_fit(comparison, folder)


def _print(comparison: Comparison, result: dict[str, Any]) -> None:
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


def _constants(fit: Fit) -> list[str]:
    """One line per constant with its limits."""
    lines = []
    for index, (name, value, limits) in enumerate(zip(fit.family.constants, fit.values, fit.limits,
                                                      strict=True)):
        unit, size = (" kPa", 1e3) if index < len(fit.family.linear) else ("", 1.0)
        low, high = ("none" if limit is None else f"{limit / size:.4g}" for limit in limits)
        lines.append(f"{name} = {value / size:.5g}{unit}  ({low} to {high})")
    return lines
