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
from tympan.fem.film.library import load_specimen
from tympan.studies.case import Case, Settings, solve

ROOT = Path(__file__).parent.parent
#: Pages that tell how to extend the package, which takes its inner modules.
EXTENDING = {"docs/contributing.md", "docs/howto/own-film.md"}
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


#: Columns of the examples' readings, whose values are the film's, and their errors in turn [mm].
COLUMNS = "specimen,mass_g,voltage_kV,displacement_mm\n"
ERRORS = (0.002, -0.003, 0.001, -0.002, 0.004, -0.001)
COUPON = "mode,stretch,nominal_stress_kPa\n" + "".join(
    f"uniaxial,{stretch},{20 * (stretch - stretch**-2):.3f}\n"
    for stretch in (1.1, 1.3, 1.6, 2.0, 2.5, 3.0))
REQUIREMENTS = """specimen = "oval.toml"
mass = "17.9 g"
voltage = "3 kV"
tolerances = "none"
[want]
stroke = "largest"
frame_area = "70 cm^2"
[vary]
"frame.semi_axes.0" = ["5 cm", "7 cm"]
"plate.radius" = ["8 mm", "12 mm"]
"""
STUDY = 'specimens = ["oval.toml"]\nmass = "17.9 g"\nvoltage = "2 kV"\n'
#: A table whose headings are no columns' names.
WEIGHTS = "Mass (g),Voltage (kV),Deflection (mm)\n10,0,1.2\n10,1,1.25\n20,0,2.4\n"


def test_the_examples_of_the_api_page_are_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch
                                                ) -> None:
    monkeypatch.chdir(tmp_path)
    written(tmp_path, 'specimen = "oval.toml"\nmass = ["17.9 g"]\nvoltage = ["0 kV", "2 kV"]',
            REQUIREMENTS=REQUIREMENTS, STUDY=STUDY)
    for name, text in (("weights", WEIGHTS), ("coupon", COUPON)):
        (tmp_path / f"{name}.csv").write_text(text, encoding="utf-8")
    film = load_specimen(Path("oval.toml"))
    deflections = [(kV, 1e3 * solve(Case(film, mass="17.9 g", voltage=1e3 * kV),
                               Settings()).deflection_m)
                   for kV in (0.0, 2.0, 3.5)]
    rows = "".join(f"{film.name},17.9,{kV},{deflection + error:.4f}\n"
                   for (kV, deflection), error in zip(2 * deflections, ERRORS, strict=True))
    write_dataset(tmp_path / "readings", 'name = "r"\n[[specimen]]\nfile = "../oval.toml"\n', (),
                  static=COLUMNS + rows)
    failed, tried = doctest.testfile(str(API), module_relative=False, encoding="utf-8",
                                     globs={"tympan": tympan})
    assert not failed
    assert tried >= len(PUBLIC)
    assert "SKIP" not in API.read_text(encoding="utf-8")
