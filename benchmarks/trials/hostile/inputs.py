"""Files that can be read, and cases made by changing one place of them."""

from __future__ import annotations

from benchmarks.trials.fuzz.contents import BODY, COUPON, DATASET, OVAL, STATIC, TRANSIENT
from benchmarks.trials.hostile.case import Case

__all__ = ["BODY", "COUPON", "DATASET", "GOOD", "LOADS", "OVAL", "SAMPLE", "SOLVE", "SPECIMEN",
           "STATIC", "TRANSIENT", "VHB", "of_coupon", "of_dataset", "of_specimen", "of_sweep"]

VHB = 'material = "vhb-4910"\n'
SPECIMEN = OVAL + VHB
GOOD: dict[str, str | bytes | None] = {"specimen.toml": SPECIMEN}
SOLVE = "solve specimen.toml --mass '1 g'"
LOADS = 'specimen = "specimen.toml"\nmass = "17.9 g"\nvoltage = "1 kV"\n'
SAMPLE = '[sample]\nmethod = "sobol"\ncount = 8\n[sample.ranges]\n'


def of_specimen(name: str, old: str, new: str, words: str) -> Case:
    """A solve of the specimen with one place changed."""
    assert old in SPECIMEN
    return Case(name, SOLVE, {"specimen.toml": SPECIMEN.replace(old, new, 1)},
                f"specimen.toml: .*{words}")


def of_sweep(name: str, text: str, words: str) -> Case:
    """A sweep by a file of this text."""
    return Case(name, "sweep SWEEP.toml -o out", {"specimen.toml": SPECIMEN, "SWEEP.toml": text},
                words)


def of_dataset(name: str, command: str, words: str, **tables: str | None) -> Case:
    """A command on the folder ``data`` with these tables."""
    files = {f"data/{table}.csv": content for table, content in tables.items()}
    return Case(name, command, {"data/dataset.toml": DATASET, **files}, words)


def of_coupon(name: str, words: str, content: str, options: str = "") -> Case:
    """A fit of this table of a test strip."""
    return Case(name, f"material fit coupon.csv -o out {options}", {"coupon.csv": content}, words)
