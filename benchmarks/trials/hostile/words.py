"""Words that nearly are the right ones."""

from __future__ import annotations

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import GOOD, of_specimen


def _python(name: str, code: str, words: str) -> Case:
    """A script that catches nothing but our errors and prints their line."""
    script = ("import sys\nimport tympan\ntry:\n    " + code + "\nexcept Exception as error:\n"
              "    sys.exit(f'{type(error).__name__}: {error}')\n")
    return Case(name, "a.py", {"a.py": script, **GOOD}, words, 1, program=(), seconds=10.0)


@group("words")
def words() -> Cases:
    yield of_specimen("width", "thickness", "thicknes", "did you mean it by .thicknes.")
    yield of_specimen("[film]", "[membrane]", "[film]", "membrane")
    yield Case("sovle", "sovle specimen.toml", GOOD, "did you mean.*solve")
    yield _python("typo of a keyword", "tympan.solve('specimen.toml', mas='1 g')", "mass")
