"""The page of all claims as Markdown, and the picture of the orders of convergence."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import numpy as np

from benchmarks.verification import closed_forms, membrane, references, stability, vibrations
from benchmarks.verification.claim import CLAIMS, Claim, Pair
from benchmarks.verification.membrane import ORDERS, errors

#: Modules whose claims the page shows. One more module of claims is one more name here.
CHAPTERS = {references: "The references themselves", closed_forms: "Closed forms",
            membrane: "The axisymmetric membrane", stability: "Pull-in and loss of tension",
            vibrations: "Small vibrations"}

Judged = dict[Claim, list[tuple[Pair, bool]]]

_INTRODUCTION = """# Verification against exact solutions

Written by `make verification`, which runs every claim, and fails if one does. The test suite runs
the same claims at the same tolerances. An error is relative, unless the reference is 0 or an
order of convergence, of which only falling short counts. Unless a claim says otherwise the film
is 1 mm thick before it is stretched by √5 along both axes, lies between circles of 10 and 45 mm,
has ε_r 4.7, is neo-Hooke 20 kPa, and is meshed as a user gets it: curved triangles of order 4, a
quarter by symmetry. The references are in `tests/oracles/`: `axisymmetric.py`, `inflation.py`,
`unstable.py`, `laws.py`; they import nothing of the program that they check.
"""


def claims() -> list[Claim]:
    """All claims, in the order of the page."""
    order = [chapter.__name__ for chapter in CHAPTERS]
    return sorted(CLAIMS, key=lambda claim: order.index(claim.pairs.__module__))


def written(judged: Judged) -> str:
    """The page."""
    return "\n".join([_INTRODUCTION, *_summary(judged), "", *_details(judged), _versions()]) + "\n"


def _summary(judged: Judged) -> Iterator[str]:
    passed = sum(all(fine for _, fine in pairs) for pairs in judged.values())
    yield (f"{passed} of {len(judged)} claims hold, "
           f"with {sum(map(len, judged.values()))} numbers compared.\n")
    yield "| claim | numbers | largest error | tolerance | holds |\n|---|---:|---:|---:|---|"
    for claim, pairs in judged.items():
        worst, holds = max(pair.error for pair, _ in pairs), _word(all(fine for _, fine in pairs))
        yield f"| {claim.title} | {len(pairs)} | {worst:.1e} | {claim.tolerance:.2g} | {holds} |"


def _details(judged: Judged) -> Iterator[str]:
    for chapter, title in CHAPTERS.items():
        yield f"## {title}\n"
        for claim, pairs in judged.items():
            if claim.pairs.__module__ == chapter.__name__:
                yield from _detail(claim, pairs)
        if chapter is membrane:
            yield ("![Errors of force and rim stress against the number of elements]"
                   "(verification.png)\n")


def _detail(claim: Claim, pairs: list[tuple[Pair, bool]]) -> Iterator[str]:
    words = " ".join((claim.pairs.__doc__ or "").split())
    yield f"### {claim.title}\n\n{words} Reference: {claim.reference}.\n"
    yield ("| quantity | computed | reference | error | tolerance | holds |\n"
           "|---|---:|---:|---:|---:|---|")
    for pair, fine in pairs:
        unit = f" {pair.unit}" if pair.unit else ""
        least = "≥ " if pair.at_least else ""
        yield (f"| {pair.quantity} | {pair.computed:.9g}{unit} | "
               f"{least}{pair.reference:.9g}{unit} | {pair.error:.1e} | "
               f"{claim.tolerance:.2g} | {_word(fine)} |")
    yield ""


def _word(fine: bool) -> str:
    return "yes" if fine else "**NO**"


def _versions() -> str:
    packages = ", ".join(f"{name} {version(name)}" for name in ("tympan", "numpy", "scipy",
                                                                "scikit-fem", "gmsh"))
    return f"## Versions\n\nPython {platform.python_version()}, {packages}."


def draw(path: Path) -> None:
    """Errors against the number of elements along a side, for every order of element."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 3.6), layout="constrained")
    shown = (0, "plate force"), (2, "peak stress at the rim")
    for axes, (column, words) in zip(figure.subplots(1, 2), shown, strict=True):
        for order, *_ in ORDERS:
            counts = np.array([2, 4, 8, 16][: 6 - order])
            values = np.array([errors(order, int(count))[column] for count in counts])
            axes.loglog(counts, values, "o-", label=f"P{order}")
        axes.set(xlabel="elements along a side of the quarter",
                 ylabel=f"relative error of the {words}", xticks=counts)
        axes.set_xticks([2, 4, 8, 16], ["2", "4", "8", "16"])
        axes.minorticks_off()
        axes.grid(True, alpha=0.3)
        axes.legend()
    figure.savefig(path, dpi=120)
