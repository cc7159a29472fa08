"""Words that nearly are the right ones."""

from __future__ import annotations

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import GOOD, of_specimen

#: A specimen in Python, of which one argument is given otherwise.
_FILM = "tympan.Film(**{{'thickness': 1e-3, 'prestretch': 2.0, 'material': 'vhb-4910', {}}})"
_BEAM = ("tympan.BuckledBeam(**{{'length': 0.04, 'width': 5e-3, 'thickness': 2e-4, 'modulus': 3e9, "
         "'compression': 1e-4, {}}})")


def _python(name: str, code: str, words: str) -> Case:
    """A script that catches nothing but our errors and prints their line."""
    script = ("import sys\nimport numpy as np\nimport tympan\ntry:\n    " + code
              + "\nexcept tympan.InputError as error:\n    sys.exit(f'{error}')\n")
    return Case(name, "a.py", {"a.py": script, **GOOD}, words, 1, program=(), seconds=10.0)


@group("words")
def words() -> Cases:
    yield of_specimen("width", "thickness", "thicknes", "did you mean it by .thicknes.")
    yield of_specimen("[film]", "[membrane]", "[film]", "membrane")
    yield Case("sovle", "sovle specimen.toml", GOOD, "did you mean.*solve")
    yield _python("typo of a keyword", "tympan.solve('specimen.toml', mas='1 g')", "mass")
    yield Case("semicolons", "curve specimen.toml --mass '10 g; 20 g' -o out", GOOD,
               "--mass: given .*must have commas between quantities, such as \"10 g, 20 g\"")
    yield Case("two masses for one", "solve specimen.toml --mass '10 g, 20 g'", GOOD,
               "--mass: .*must be one mass .*: here are several")
    for option, meant in (("--weight '1 g'", "--mass"), ("--load '1 g'", "--mass"),
                          ("--potential '1 kV'", "--voltage"), ("--folder a", "--output")):
        yield Case(option, f"solve specimen.toml {option}", GOOD, f"did you mean {meant}[?]")
    yield Case("no number", "solve specimen.toml --mass '1 g' --refine much", GOOD,
               "--refine: given 'much': must be a number")
    yield Case("help without hidden options", "alpha --help", {}, status=0, never="SUPPRESS")


@group("values of Python")
def values_of_python() -> Cases:
    """What a file may not hold is refused in Python alike, with the key and in plain words."""
    for code, words in (("'prestretch': -1", "prestretch: .*between 0.2 and 10"),
                        ("'relative_permittivity': -1", "relative_permittivity: .*at least 1"),
                        ("'thickness': -1e-3", "thickness: given '-1 mm': must be positive"),
                        ("'thickness': float('nan')", "thickness: given nan: must be positive"),
                        ("'thickness': np.ma.masked", "thickness: given 'a masked cell'"),
                        ("'relative_permittivity': True", "given True: must be one number"),
                        ("'layers': 2.5", "layers: given 2.5: must be a whole number")):
        yield _python(f"film: {code}", _FILM.format(code), words)
    yield _python("2.5 beams", _BEAM.format("'number': 2.5"), "number: given 2.5: .*whole number")
    yield _python("thick beam", _BEAM.format("'thickness': 0.1"), "thickness: .*tenth of the len")
    for number in ("10**400", "10**5000", "np.ma.masked", "True"):
        yield _python(f"mass of {number}",
                      f"tympan.Case(tympan.load('specimen.toml'), mass={number})", "^mass: given ")
    yield _python("table of one point", "tympan.ForceTable(['1 mm'], ['1 N'])",
                  "displacement: given '1 mm': must be at least 2 numbers")
    yield _python("steps of 1e-300", "tympan.ForceTable([0.0, 1e-300], [0.0, 1.0])", "by 1 nm at")
    yield _python("name that leads out", "film = tympan.load('specimen.toml')\n    "
                  "tympan.Specimen('../../esc', film.frame, film.plate, film.membrane)",
                  "name: given '../../esc': must serve as a file name")
    yield _python("no ending", "tympan.solve(tympan.load('specimen.toml'), mass='1 g').save('a.x')",
                  "file: given 'a.x': must be a folder")
    yield _python("no file", "tympan.load('')", "file: given '': is empty")
    yield _python("a list for a name", "tympan.material(['vhb-4910'])", "must be a text")
