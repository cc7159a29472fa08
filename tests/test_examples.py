"""Examples, tutorials and how-tos use ``import tympan`` alone; the API page has all that is public.
"""

from __future__ import annotations

import ast
import doctest
import inspect
import json
import re
from pathlib import Path

import pytest

import tympan
from tests.support.datasets import write_dataset
from tests.support.sweeps import written

ROOT = Path(__file__).parent.parent
#: Pages that tell how to extend the package, which takes its inner modules.
EXTENDING = {"docs/contributing.md"}
PAGES = sorted({*ROOT.glob("docs/gallery/*.py"), *ROOT.glob("examples/*.ipynb"),
                *ROOT.glob("docs/*.md"), *ROOT.glob("docs/howto/*.md"),
                *ROOT.glob("docs/explanation/*.md"), ROOT / "README.md"})


def _code(page: Path) -> str:
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".py":
        return text
    if page.suffix == ".ipynb":
        return "\n".join("".join(cell["source"]) for cell in json.loads(text)["cells"]
                         if cell["cell_type"] == "code")
    return "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_examples_import_the_door_alone(page: Path) -> None:
    if str(page.relative_to(ROOT)) in EXTENDING:
        return
    below = [ast.unparse(node) for node in ast.walk(ast.parse(_code(page)))
             if (isinstance(node, ast.ImportFrom) and str(node.module).startswith("tympan"))
             or (isinstance(node, ast.Import)
                 and any(name.name.startswith("tympan.") for name in node.names))]
    assert not below


API = ROOT / "docs" / "api.md"
#: All that is public, by the name that follows ``tympan.``.
PUBLIC = sorted({*tympan.__all__} - {"lumped", "__version__"}
                | {f"lumped.{name}" for name in vars(type(tympan.lumped)) if name[0] != "_"})


@pytest.mark.parametrize("name", PUBLIC)
def test_what_is_public_is_documented_with_an_example(name: str) -> None:
    page = API.read_text(encoding="utf-8")
    assert re.search(rf":: tympan\.{name}$", page, re.MULTILINE)
    assert re.search(rf"^>>> .*\btympan\.{name}\b", page, re.MULTILINE)
    found: object = tympan
    for part in name.split("."):
        found = getattr(found, part)
    words = (inspect.getdoc(found) or "").split()
    assert words
    assert words[0] not in {"What", "Where", "How", "Which", "When", "Whether", "Of", "As", "By"}


#: Readings of two films, for the examples; a table whose headings are no columns' names.
READINGS = "specimen,mass_g,voltage_kV,displacement_mm\n" + "".join(
    f"{name},17.9,{row}\n" for name in "AB" for row in ("0,2.1", "2,2.18", "3.5,2.4"))
WEIGHTS = "Mass (g),Voltage (kV),Deflection (mm)\n10,0,1.2\n10,1,1.25\n20,0,2.4\n"


def test_the_examples_of_the_api_page_are_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch
                                                ) -> None:
    monkeypatch.chdir(tmp_path)
    written(tmp_path, 'specimen = "oval.toml"\nmass = ["17.9 g"]\nvoltage = ["0 kV", "2 kV"]')
    write_dataset(tmp_path / "readings", static=READINGS)
    (tmp_path / "weights.csv").write_text(WEIGHTS, encoding="utf-8")
    failed, tried = doctest.testfile(str(API), module_relative=False, encoding="utf-8",
                                     globs={"tympan": tympan})
    assert not failed
    assert tried >= len(PUBLIC) - 8
