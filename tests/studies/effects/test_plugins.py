"""Effects of users' own packages: the example named in hidden data by the unchanged command, and
packages that are broken."""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.oracles.readings import swinging
from tests.oracles.readings.round_actuators import Hidden, specimen_table
from tests.support.packages import installed, run
from tests.support.specimens import specimen_toml
from tympan.base.errors import InputError
from tympan.base.fields import Registry
from tympan.base.plugins import GROUPS, load_plugins
from tympan.studies.columns import Column, read_own_sheet, read_sheet, write_sheet
from tympan.studies.effects import EFFECTS
from tympan.studies.formats import FORMATS

EXAMPLE = Path(__file__).parents[3] / "examples" / "tympan-tether"


@pytest.mark.study(seconds=33)
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
    before, broken = dict(EFFECTS), list(EFFECTS.broken)
    yield
    EFFECTS.clear()
    EFFECTS.update(before)
    EFFECTS.broken[:] = broken


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
    load_plugins("tympan.effects", EFFECTS)
    with pytest.raises(InputError) as error:
        EFFECTS.whole()
    assert "package broken-package, entry point 'shine' of tympan.effects" in str(error.value)
    assert words in str(error.value)
    assert before == EFFECTS


#: What a module does when it is imported, and what is said of it.
ACTS = {
    "raises": ("raise RuntimeError('not\\ntoday')", "RuntimeError: not today"),
    "exits": ("import sys; sys.exit(0)", "SystemExit: 0"),
    "exits at once": ("import os; os._exit(3)", "SystemExit: 3"),
    "interrupts": ("raise KeyboardInterrupt", "KeyboardInterrupt"),
    "raises what is no exception": ("raise GeneratorExit('x')", "GeneratorExit: x"),
    "raises without words": (
        "class Odd(BaseException):\n    def __str__(self):\n        return 1 / 0\nraise Odd",
        "Odd: no words"),
    "raises at length": ("raise ValueError('x' * 10**6)", "ValueError: xxx"),
    "recurses": ("def f():\n    f()\nf()", "RecursionError: maximum recursion"),
    "is no Python": ("def (", "SyntaxError: invalid syntax"),
    "asks": ("input('name? ')", "EOFError"),
    "prints": ("import os, sys\nprint('A')\nos.write(1, b'B')\nos.write(2, b'C')\n"
               "sys.stderr.write('D')\nprint('E', file=sys.__stdout__)\n"
               "import subprocess; subprocess.run(['echo', 'F'])", "must register a law"),
    "warns": ("import warnings; warnings.simplefilter('always'); warnings.warn('A')",
              "must register a law"),
    "logs": ("import logging, sys\nlogging.basicConfig(stream=sys.stdout, level=0)\n"
             "logging.warning('A')\nlogging.getLogger('matplotlib').setLevel(0)",
             "must register a law"),
    "goes elsewhere": ("import os, sys\nos.chdir('/')\nos.environ.clear()\n"
                       "sys.argv[:] = ['x']\nsys.stdout = sys.stderr = None\n"
                       "sys.excepthook = print\nos.environ = {}", "must register a law"),
    "takes signals": ("import signal\nfor n in (2, 13, 14, 15): signal.signal(n, signal.SIG_IGN)",
                      "must register a law"),
    "closes": ("import os, sys\nsys.stdout.close()\nos.close(1)\nos.close(2)",
               "must register a law"),
    "changes words": ("import builtins\nbuiltins.print = builtins.float = None",
                      "must register a law"),
    "changes numbers": ("import numpy, sys\nnumpy.seterr(all='raise')\n"
                        "sys.setrecursionlimit(200)", "must register a law"),
    "says farewell": ("import atexit\natexit.register(print, 'A')\n"
                      "import os; atexit.register(os.write, 1, b'B')", "must register a law"),
}


def _of_the_process() -> list[object]:
    """What a module may change of the process."""
    log = logging.getLogger()
    return [Path.cwd(), os.environ, dict(os.environ), sys.argv[:], sys.excepthook, print, float,
            *(getattr(sys, name) for name in ("stdin", "stdout", "stderr", "__stdout__")), os._exit,
            log.level, log.manager.disable, log.handlers[:], np.geterr(), sys.getrecursionlimit(),
            [signal.getsignal(number) for number in sorted(signal.valid_signals())]]


@pytest.mark.parametrize(("number", "act", "said"),
                         [(number, *rest) for number, rest in enumerate(ACTS.values())], ids=ACTS)
def test_whatever_a_package_does_stays_with_it(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str],
        number: int, act: str, said: str) -> None:
    module = f"broken_law_{number}"
    act = act.replace("atexit.register", "(lambda *_: None)")  # which would be those of all tests
    (tmp_path / f"{module}.py").write_text(act + "\n")
    installed(tmp_path, "broken-law", {"tympan.laws": {"odd": module}})
    monkeypatch.syspath_prepend(str(tmp_path))
    before, kinds = _of_the_process(), Registry[object]("law")
    load_plugins("tympan.laws", kinds)
    assert _of_the_process() == before
    assert capfd.readouterr() == ("", "")
    with pytest.raises(InputError) as error:
        kinds.whole("odd")
    assert (f"package broken-law, entry point 'odd' of tympan.laws: given '{module}': "
            f"{'' if said.startswith('must') else 'cannot be loaded: '}{said}") in str(error.value)
    assert len(str(error.value)) < 400


@pytest.mark.parametrize("acts", [["exits at once"], ["interrupts"],
                                  ["prints", "logs", "goes elsewhere", "takes signals", "closes",
                                   "changes words", "says farewell"]], ids=" ".join)
def test_a_command_ends_in_one_line_or_goes_on(tmp_path: Path, acts: list[str]) -> None:
    """One line where the law is asked for; what needs none of it goes on, as if it were not there.
    """
    (tmp_path / "broken_law.py").write_text("\n".join(ACTS[act][0] for act in acts) + "\n")
    installed(tmp_path, "broken-law", {"tympan.laws": {"odd": "broken_law"}})
    done = run("material", "show", "vhb-4910", "--json", path=(tmp_path,), cache="")
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["law"] == "ogden"
    odd = tmp_path / "odd.toml"
    odd.write_text(specimen_toml().replace('material = "vhb-4910"\n', "")
                   + '[membrane.material]\nlaw = "odd"\n')
    done = run("solve", str(odd), "--mass", "1 g", "--json", path=(tmp_path,), cache="")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("tympan: package broken-law, entry point 'odd' of tympan.laws: ")
    assert done.stderr.count("\n") == 1


def test_every_door_asks_for_what_it_needs(tmp_path: Path) -> None:
    """A broken format ends what reads tables, a broken effect what diagnoses; nothing else."""
    (tmp_path / "broken.py").write_text("raise RuntimeError('not today')\n")
    installed(tmp_path, "broken", {group: {"odd": "broken"} for group in GROUPS})
    data = swinging.write(tmp_path / "d", Hidden(), seed=4, noise=5e-6, swings=False)
    (tmp_path / "oval.toml").write_text(specimen_toml())
    for group, *words in (("tympan.formats", "data", str(data)), ("tympan.effects", "effects"),
                          ("", "materials"), ("", "solve", str(tmp_path / "oval.toml"), "--mass",
                                              "20 g", "--refine", "0.5")):
        done = run(*words, path=(tmp_path,), cache="")
        assert done.returncode == (2 if group else 0), done.stderr
        assert done.stderr.count("\n") == bool(group)
        assert f"package broken, entry point 'odd' of {group}" in done.stderr or not group


def test_results_are_read_without_formats_of_packages(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    columns = (Column("voltage", "kV"),)
    write_sheet(tmp_path / "a.csv", columns, {"voltage": np.array([1e3])})
    monkeypatch.setattr(FORMATS, "broken", [InputError("not today")])
    assert read_own_sheet(tmp_path / "a.csv", columns)["voltage"].tolist() == [1e3]
    with pytest.raises(InputError, match="not today"):
        read_sheet(tmp_path / "a.csv", columns)


def test_a_list_of_entry_points_that_cannot_be_read_is_named(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info = installed(tmp_path, "odd", {}) / "odd-0.1.0.dist-info"
    (info / "entry_points.txt").write_bytes(b"[tympan.laws]\nodd = \xff\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    kinds: Registry[object] = Registry("law")
    load_plugins("tympan.laws", kinds)
    with pytest.raises(InputError, match=r"odd-0.1.0.dist-info, entry points: cannot be read: Uni"):
        kinds.whole()


def test_an_interruption_from_outside_is_none_of_the_package(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "slow_law.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n"
                                          "while True: pass\n")
    installed(tmp_path, "slow-law", {"tympan.laws": {"odd": "slow_law"}})
    monkeypatch.syspath_prepend(str(tmp_path))
    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        load_plugins("tympan.laws", Registry("law"))
    assert signal.getsignal(signal.SIGINT) is handler


def test_laws_and_outlines_are_added_the_same_way(tmp_path: Path) -> None:
    (tmp_path / "soft_law.py").write_text(
        "from dataclasses import dataclass\nfrom typing import Annotated, ClassVar\n"
        "from tympan.fem.film.laws.invariants import FirstInvariantLaw\n"
        "from tympan.base.fields import Key\nfrom tympan.geometry.specimen import LAWS\n"
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
