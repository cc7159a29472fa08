"""Slips of the pen, which a message asks about; what a sweep cannot be asked."""

from __future__ import annotations

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import GOOD, LOADS, SOLVE, SPECIMEN, STATIC

SWEEP = {**GOOD, "SWEEP.toml": LOADS.replace('"1 kV"', '["0 kV", "1 kV"]')}
_NAMED = '[[specimen]]\nfile = "{}"\n'


@group("did you mean")
def slips() -> Cases:
    """Commands, options, keys and names near those that exist."""
    yield Case("command", "sovle specimen.toml", GOOD, "did you mean 'solve'")
    yield Case("command of a group", "material fitt x.csv", {}, "did you mean 'fit'")
    yield Case("option", f"{SOLVE} --voltagee '1 kV'", GOOD, "did you mean --voltage")
    yield Case("value in two words", "solve specimen.toml --mass 1 g", GOOD, "quotation marks")
    yield Case("kilograms for grams", "solve specimen.toml --mass '17.9 kg' --voltage '3 V'", GOOD,
               status=0, shows='was "17.9 g" meant(.|\n)*was "3 kV" meant')
    yield Case("kilograms for grams, lumped", "lumped simulate specimen.toml --paper --mass "
               "'17.9 kg' --signal step --high '3 V' --duration '1 s'", GOOD,
               'was "17.9 g" meant(.|\n)*was "3 kV" meant')
    yield Case("table", SOLVE, {"specimen.toml": SPECIMEN.replace("[membrane]", "[film]")},
               "membrane: is missing: did you mean it by 'film'")
    yield Case("material", SOLVE, {"specimen.toml": SPECIMEN.replace("vhb-4910", "vhb4910")},
               "did you mean 'vhb-4910'")


@group("best of a sweep")
def best() -> Cases:
    """Refused before anything is solved."""
    line = "sweep SWEEP.toml -o out"
    yield Case("no such result", f"{line} --best strok", SWEEP, "--best: .*did you mean 'stroke'")
    yield Case("no such voltage", f"{line} --voltage '3 kV'", SWEEP,
               "--voltage: .*must be one of the sweep")
    yield Case("other unit", f"{line} --best stroke --under 'max_true_stress < 3 kV'", SWEEP,
               "--under: .*wrong dimension")
    yield Case("conditions alone", f"{line} --under 'stroke < 3 mm'", SWEEP, "needs --best")


@group("specimen's file")
def named_specimens() -> Cases:
    """Datasets that name the files of their specimens."""
    def data(entry: str) -> dict[str, str | bytes | None]:
        return {"data/dataset.toml": f'name = "d"\n{entry}', "data/static.csv": STATIC}

    yield Case("missing", "data data", data(_NAMED.format("none.toml")),
               "none.toml: cannot be read")
    yield Case("file and keys", "data data", data(_NAMED.format("a.toml") + 'name = "a"\n'),
               "specimen.0.file: .*must stand alone")
    yield Case("a folder", "data data", data(_NAMED.format("..")), "cannot be read")
