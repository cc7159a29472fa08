"""VHB coupons fitted, beside published fits: ``python -m benchmarks.vhb`` (``make coupons``).

Writes docs/coupons.md and its figures, and prints the library's entries.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.vhb.published import AT_REST, KUMAR, README_FIT, Published
from tympan.base.arrays import Array, Mask
from tympan.reports.figures.coupon import draw_fit
from tympan.studies.data.coupon import Coupons, read_coupons
from tympan.studies.material.branches import BranchFit, compare_in_time, held_out_groups
from tympan.studies.material.fit import ParameterLimits
from tympan.studies.material.result import fit_coupons

HERE = Path(__file__).parent
DOCS = HERE.parent.parent / "docs"
#: The law of the library's entries; the page says why none that foretells uniaxial tests better.
LAW = "neo_hooke"
TAPES = {"vhb-4910": (README_FIT, KUMAR), "vhb-4905": (README_FIT,)}


def main() -> None:
    """Fit both tapes, write the page."""
    lines = (HERE / "page.md").read_text(encoding="utf-8").splitlines()
    for tape, published in TAPES.items():
        coupons = read_coupons(HERE / f"{tape}.csv")
        fits = compare_in_time(coupons)
        chosen = next(fit for fit in fits if fit.law.family.name == LAW)
        lines += ["", f"## {tape.upper().replace('-', ' ')}", "", *constants(chosen), "",
                  *misfits(coupons, chosen, published), "", *laws(fits), "",
                  *rest(tape, coupons, chosen)]
        draw(tape)
        lines += ["", f"![Tests of {tape} in time, and its law at rest]({tape}.png)"]
        for branch in (chosen.law.values[0], *chosen.values):
            print(tape, f"{branch:.4g}")
    lines += ["", *late_times()]
    (DOCS / "coupons.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def draw(tape: str) -> None:
    """The figure that the command makes."""
    with tempfile.TemporaryDirectory() as folder:
        picture, *_ = draw_fit(fit_coupons(HERE / f"{tape}.csv", [LAW]), Path(folder), dpi=200)
        shutil.copy(picture, DOCS / f"{tape}.png")


def constants(fit: BranchFit) -> Iterator[str]:
    """The law and branches with their limits."""
    yield "| constant | value | 95 % limits |"
    yield "|---|---:|---:|"
    yield _row("μ at rest", fit.law.values[0] / 1e3, fit.law.limits[0], 1e3, "kPa")
    for number, branch in enumerate(fit.branches):
        modulus, time = fit.limits[number], fit.limits[fit.count + number]
        yield _row(f"modulus of branch {number + 1}", branch.modulus / 1e3, modulus, 1e3, "kPa")
        yield _row(f"time of branch {number + 1}", branch.time, time, 1.0, "s")
    yield ""
    yield (f"Neighbouring residuals are correlated by {fit.correlation:.3f}. By the number of "
           "branches, runs held out are missed by " + ", ".join(
               f"{error / 1e3:.2f} kPa ({count})" for count, error in fit.tried.items()
               if error is not None) + ".")


def _row(name: str, value: float, limits: ParameterLimits, size: float, unit: str) -> str:
    low, high = ("none" if limit is None else np.format_float_positional(
        limit / size, 3, fractional=False, trim="-") for limit in limits)
    return f"| {name} | {value:.4g} {unit} | {low} to {high} |"


def misfits(coupons: Coupons, fit: BranchFit, published: tuple[Published, ...]) -> Iterator[str]:
    """By what is held out: fitted to the others, fitted to all, and the published fits."""
    columns = [fit.stress, *(other.stress(coupons) for other in published)]
    yield ("| kPa | fitted to the others | fitted to all | "
           + " | ".join(other.name for other in published) + " |")
    yield "|---|" + "---:|" * (len(columns) + 1)
    for group, mask in held_out_groups(coupons).items():
        error = fit.law.held_out[group]
        cells = [np.nan if error is None else error, *(_rms((stress - coupons.stress)[mask])
                                                       for stress in columns)]
        yield f"| {group} | " + " | ".join(f"{cell / 1e3:.2f}" for cell in cells) + " |"
    cells = [_rms(stress - coupons.stress) for stress in columns]
    yield "| all readings | | " + " | ".join(f"{cell / 1e3:.2f}" for cell in cells) + " |"
    yield ""
    yield from (f"*{other.name}*: {other.source}." for other in published)


def laws(fits: tuple[BranchFit, ...]) -> Iterator[str]:
    """How other laws foretell what is held out, and what they make of a mounted film at rest."""
    mounted = np.array([5**0.5])
    yield "| law | branches | held out | true stress of an equibiaxial film at √5, at rest |"
    yield "|---|---:|---:|---:|"
    for fit in fits:
        law = fit.law
        stress = float((law.family.stress(mounted, mounted, law.values) * mounted).item())
        yield (f"| {law.family.name} | {fit.count} | {(fit.foretold or np.nan) / 1e3:.2f} kPa "
               f"| {stress / 1e3:,.0f} kPa |")


def rest(tape: str, coupons: Coupons, fit: BranchFit) -> Iterator[str]:
    """Readings at rest, or the last of relaxation, beside published laws of the film at rest."""
    at_rest = np.isnan(coupons.time)
    groups = {f"series {name[-1]}": at_rest & (coupons.run == name)
              for name in dict.fromkeys(coupons.run[at_rest].tolist())}
    if not groups:
        groups = {"after 3 h": coupons.time > 11_000}
    columns = {"this fit": fit.stress, **_without(coupons, at_rest, fit)}
    columns |= {other.name: other.stress(coupons) for other in AT_REST[tape]}
    yield f"| kPa | {' | '.join(columns)} |"
    yield "|---|" + "---:|" * len(columns)
    for name, mask in groups.items():
        errors = (_rms((stress - coupons.stress)[mask]) for stress in columns.values())
        yield f"| at rest, {name} | " + " | ".join(f"{error / 1e3:.2f}" for error in errors) + " |"


def _without(coupons: Coupons, at_rest: Mask, fit: BranchFit) -> dict[str, Array]:
    """What a fit to the readings in time says of those at rest."""
    if not at_rest.any():
        return {}
    alone, = compare_in_time(coupons[~at_rest], [LAW], branches=fit.count)
    law = alone.law.family.stress(*coupons.in_plane, alone.law.values)
    return {"fitted in time alone": np.where(at_rest, law, np.nan)}


def late_times() -> Iterator[str]:
    """The relaxation of 4905 with times that begin 900 s earlier."""
    coupons = read_coupons(HERE / "vhb-4905.csv")
    relaxing = np.char.startswith(coupons.run.astype(str), "held")
    fit, = compare_in_time(replace(coupons, time=coupons.time - 900.0 * relaxing), [LAW])
    branches = ", ".join(f"{branch.modulus / 1e3:.3g} kPa with {branch.time:.3g} s"
                         for branch in fit.branches)
    yield (f"With relaxation times of 4905 that are 900 s less: {fit.law.values[0] / 1e3:.3g} kPa "
           f"at rest, {branches}; held out {(fit.foretold or np.nan) / 1e3:.2f} kPa.")


def _rms(missed: Array) -> float:
    return float(np.sqrt(np.mean(missed**2)))


if __name__ == "__main__":
    main()
