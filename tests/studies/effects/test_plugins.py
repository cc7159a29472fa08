"""Effects of users' own packages: the example named in hidden data by the unchanged command, and
packages that are broken."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.oracles.readings import swinging
from tests.oracles.readings.round_actuators import Hidden, specimen_table
from tests.support.packages import installed, run
from tympan.geometry.errors import InputError
from tympan.geometry.plugins import load_plugins
from tympan.studies.effects import EFFECTS

EXAMPLE = Path(__file__).parents[3] / "examples" / "tympan-tether"


def test_the_example_is_named_by_the_unchanged_command(tmp_path: Path) -> None:
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]
    site = installed(tmp_path / "site", project["name"], project["entry-points"])
    data = swinging.write(tmp_path / "d", Hidden(tether=2e-3), seed=4, noise=5e-6, swings=False)
    done = run("diagnose", str(data), "-o", str(tmp_path / "out"), "--json", path=(EXAMPLE, site),
               cache=os.environ["TYMPAN_CACHE"])
    assert done.returncode == 0, done.stderr
    verdict = json.loads(done.stdout)
    assert verdict["verdict"] == "named", verdict["headline"]
    cause = verdict["causes"][0]
    assert cause["effect"] == "tether"
    assert cause["parameters"]["F_1"]["value"] == pytest.approx(2, rel=0.15)
    assert 'law = "tether"' in (tmp_path / "out" / "extended" / "rig.toml").read_text()


@pytest.fixture
def effects() -> Iterator[None]:
    before = dict(EFFECTS)
    yield
    EFFECTS.clear()
    EFFECTS.update(before)


BROKEN = [
    ("import nothing_of_this_name\n",
     "cannot be loaded: ModuleNotFoundError: No module named 'nothing_of_this_name'"),
    ("", "must register an effect"),
    ("from tympan.studies.effects.effect import effect\n"
     "@effect('It is.', finding='It is', check='look')\ndef shine(setup):\n    return setup\n",
     "TypeError: the effect shine needs an argument annotated with an EffectParameter"),
    ("from typing import Annotated\n"
     "from tympan.studies.effects.effect import EffectParameter, effect\n"
     "@effect('It is.', finding='It is {k}', check='look')\n"
     "def sensor_gain(setup, k: Annotated[float, EffectParameter('k', '', 1, 0, 2, 'none')]):\n"
     "    return setup\n", "must have a name of its own: there is already an effect sensor_gain"),
    ("from typing import Annotated\n"
     "from tympan.studies.effects.effect import EffectParameter, effect\n"
     "@effect('It is.', finding='It is {q}', check='look')\n"
     "def shine(setup, k: Annotated[float, EffectParameter('k', '', 1, 0, 2, 'none')]):\n"
     "    return setup\n", "the finding of shine speaks of q"),
]


@pytest.mark.parametrize(("number", "text", "words"),
                         [(number, *rest) for number, rest in enumerate(BROKEN)])
@pytest.mark.usefixtures("effects")
def test_broken_packages_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int,
                                   text: str, words: str) -> None:
    module, before = f"broken_{number}", dict(EFFECTS)
    (tmp_path / f"{module}.py").write_text(text)
    installed(tmp_path, "broken-package", {"tympan.effects": {"shine": module}})
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(InputError) as error:
        load_plugins("tympan.effects", EFFECTS)
    assert "package broken-package, entry point 'shine' of tympan.effects" in str(error.value)
    assert words in str(error.value)
    assert before == EFFECTS


def test_a_command_ends_with_one_message(tmp_path: Path) -> None:
    (tmp_path / "broken_law.py").write_text("raise RuntimeError('not today')\n")
    installed(tmp_path, "broken-law", {"tympan.laws": {"odd": "broken_law"}})
    done = run("material", "show", "vhb-4910", path=(tmp_path,), cache="")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "package broken-law" in done.stderr
    assert "RuntimeError: not today" in done.stderr


def test_laws_and_outlines_are_added_the_same_way(tmp_path: Path) -> None:
    (tmp_path / "soft_law.py").write_text(
        "from dataclasses import dataclass\nfrom typing import Annotated, ClassVar\n"
        "from tympan.fem.film.laws.invariants import FirstInvariantLaw\n"
        "from tympan.geometry.fields import Key\nfrom tympan.geometry.specimen import LAWS\n"
        "@LAWS.register\n@dataclass(frozen=True)\nclass Soft(FirstInvariantLaw):\n"
        "    law: ClassVar[str] = 'soft'\n"
        "    slope: Annotated[float, Key('half the modulus', 'stress')]\n"
        "    def energy(self, excess):\n"
        "        return self.slope * excess, self.slope + 0 * excess, 0 * excess\n")
    installed(tmp_path, "soft-law", {"tympan.laws": {"soft": "soft_law"}})
    specimen = specimen_table("middle", swinging.DENSITY)
    specimen = specimen.replace("[[specimen]]\n", "").replace("[specimen.", "[")
    (tmp_path / "hooke.toml").write_text(specimen)
    (tmp_path / "soft.toml").write_text(specimen.replace('law = "neo_hooke", mu = "20 kPa"',
                                                         'law = "soft", slope = "10 kPa"'))
    deflections = [json.loads(run("solve", str(tmp_path / f"{name}.toml"), "--mass", "10 g",
                                  "--voltage", "1 kV", "--json", "--refine", "0.5",
                                  path=(tmp_path,), cache="").stdout)["deflection_m"]
                   for name in ("hooke", "soft")]
    assert deflections[1] == pytest.approx(deflections[0], rel=1e-9)
