"""Words that nearly are the right ones, and numbers that cannot be meant."""

from __future__ import annotations

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import GOOD, SPECIMEN, of_specimen


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


@group("numbers not meant")
def numbers_not_meant() -> Cases:
    """They may be right, so that a line says what is odd and the answer follows."""
    for name, option, words in (("17.9 kg", "--mass '17.9 kg'", "17.9 kg"),
                                ("3 V", "--mass '17.9 g' --voltage '3 V'", "3 V")):
        yield Case(name, f"solve specimen.toml {option}", {"specimen.toml": SPECIMEN}, status=0,
                   shows=words, seconds=60.0)
