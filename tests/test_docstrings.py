"""Examples in docstrings give what they show."""

from __future__ import annotations

import doctest
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
#: Packages as they are imported, and the folder of each.
PACKAGES = {"tympan": "tympan", **{f"tympan.{name}": name
                                   for name in ("base", "tables", "geometry", "fem", "studies",
                                                "reports")}}


def modules() -> list[str]:
    """Modules of the product with an example in a docstring.

    Found in their text, so that none is imported while tests are collected.
    """
    found = []
    for package, folder in PACKAGES.items():
        files = [file for file in (ROOT / folder).rglob("*.py") if ">>> " in
                 file.read_text(encoding="utf-8")]
        for file in files:
            parts = file.relative_to(ROOT / folder).with_suffix("").parts
            found.append(".".join((package, *parts)).removesuffix(".__init__"))
    return sorted(set(found))


@pytest.mark.parametrize("module", modules())
def test_examples_of_a_module(module: str) -> None:
    failed, tried = doctest.testmod(import_module(module), optionflags=doctest.ELLIPSIS)
    assert tried > 0
    assert failed == 0
