"""Tables by the features of their makers: read right, or refused with advice that works.

``python -m benchmarks.trials.tables [COUNT] [SEED]`` counts both.
"""

from __future__ import annotations

import random
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tympan.base.errors import InputError
from tympan.studies.columns import Sheet
from tympan.studies.data.coupon import Coupons
from tympan.studies.data.dataset import Dataset, read_dataset

SPECIMEN = """[[specimen]]
name = "circle"
[specimen.frame]
shape = "circle"
radius = "4.5 cm"
[specimen.plate]
shape = "circle"
radius = "1 cm"
[specimen.membrane]
thickness = "1 mm"
prestretch = [2.236, 2.236]
relative_permittivity = 4.7
material = "vhb-4910"
"""
#: Headings in three languages, and what others have whose reader must ask.
_TITLES = {
    "t": ("Time", "Prüfzeit", "Temps"),
    "voltage": ("Voltage", "Spannung", "Tension"),
    "displacement": ("Displacement", "Standardweg", "Déplacement"),
    "force": ("Load", "Standardkraft", "Force"),
    "mass": ("Mass", "Masse", "Masse"),
    "stretch": ("Tensile strain", "Dehnung", "Déformation"),
    "nominal_stress": ("Tensile stress", "Zugspannung", "Contrainte")}
_UNITS = {"t": (("s", 1.0), ("min", 60.0)), "voltage": (("kV", 1e3), ("V", 1.0)),
          "displacement": (("mm", 1e-3), ("µm", 1e-6)), "force": (("N", 1.0), ("mN", 1e-3)),
          "mass": (("g", 1e-3), ("kg", 1.0)), "stretch": (("%", 0.01), ("mm/mm", 1.0)),
          "nominal_stress": (("MPa", 1e6), ("kPa", 1e3), ("N/mm²", 1e6))}
#: The units of our own titles, which advice on a heading without one has.
_UNSAID = {"t": ("s", 1.0), "voltage": ("kV", 1e3), "displacement": ("mm", 1e-3),
           "force": ("mN", 1e-3), "mass": ("g", 1e-3), "stretch": ("", 1.0),
           "nominal_stress": ("kPa", 1e3)}
#: Columns of each kind of file.
_KINDS = {"static": ("voltage", "mass", "displacement"),
          "transient": ("t", "voltage", "displacement"),
          "force": ("t", "displacement", "force"), "coupon": ("t", "stretch", "nominal_stress")}
#: What the laboratory knows of tables that do not say it.
_KNOWN = {"mass_g": "17.9", "voltage_kV": "3", "mode": '"uniaxial"'}
_ADVICE = re.compile(r"below a line \[columns\.\w+\]: (?P<line>.+)")


@dataclass(frozen=True)
class Made:
    """A table of one maker: its ``kind``, its bytes, and the SI values in it by column."""

    kind: str
    content: bytes
    values: dict[str, list[float]]
    features: tuple[str, ...]


def made(seed: int) -> Made:
    """One table by a seed."""
    draw = random.Random(seed)
    kind = draw.choice(sorted(_KINDS))
    language = draw.randrange(3)
    mark = draw.choice(";\t") if language else draw.choice(",;\t")
    decimal = "," if language and mark != "," else "."
    encoding = draw.choice(("utf-8", "utf-8-sig", "utf-16", "cp1252"))
    units = draw.choice(("({})", "[{}]", "/ {}", "below", "none"))
    titles, below, values, columns = [], [], {}, []
    for name in _KINDS[kind]:
        unit, factor = draw.choice(_UNITS[name])
        if units == "none":
            unit, factor = _UNSAID[name]
        numbers = [round(draw.uniform(1.1, 1.9) * (row + 1) / factor * _SIZE[name], 4)
                   for row in range(5)]
        values[name] = [number * factor + (name == "stretch") for number in numbers]
        columns.append([f"{number:.4f}".replace(".", decimal) for number in numbers])
        word = _TITLES[name][language]
        titles.append(word if units in ("below", "none") else f"{word} {units.format(unit)}")
        below.append(unit)
    rows = [[*row, ""] for row in zip(*columns, strict=True)]
    remark = ("Remark", "Bemerkung", "Remarque")[language]
    lines = [[*titles, remark]] + [[*below, ""]] * (units == "below") + rows
    preamble = draw.choice(([], [["Prüfprotokoll 12"], ["Prüfer", "Müller"], [""]]))
    lost = draw.random() < 0.3
    if lost:
        lines.append([draw.choice(("---", "NaN", "n.d.")) for _ in titles] + ["lost"])
    first = [f"sep={mark}"] if draw.random() < 0.3 and not preamble else []
    text = "\r\n".join([*first, *(mark.join(line) for line in [*preamble, *lines])]) + "\r\n"
    features = (kind, encoding, units, repr(mark), *["preamble"] * bool(preamble),
                *["sep="] * bool(first), *["lost readings"] * lost)
    return Made(kind, text.encode(encoding), values, features)


#: Usual sizes of readings [SI].
_SIZE = {"t": 60.0, "voltage": 500.0, "displacement": 1e-3, "force": 0.1, "mass": 0.01,
         "stretch": 0.2, "nominal_stress": 3e4}


def followed(folder: Path, table: Made, most: int = 6) -> tuple[Dataset, list[str]]:
    """The dataset after what each message asks for has been written; all lines that were."""
    (folder / f"{table.kind}.csv").write_bytes(table.content)
    written: list[str] = []
    while True:
        layout = "".join(f"{line}\n" for line in [f"[columns.{table.kind}]", *written])
        (folder / "dataset.toml").write_text(f'name = "d"\n{layout}{SPECIMEN}', encoding="utf-8")
        try:
            return read_dataset(folder), written
        except InputError as error:
            advice = _ADVICE.search(str(error))
            if advice is None or len(written) == most:
                raise
            written.append(_answered(advice["line"]))


def _answered(line: str) -> str:
    """A line of advice with what the laboratory knows in place of the example."""
    last = line.rpartition(" or, if it never changes, ")[2] if " or, if" in line else line
    key = last.partition(" = ")[0]
    if key in _KNOWN and "value = " in line:
        return f"{key} = {{ value = {_KNOWN[key]} }}"
    return line.partition(" or ")[0]


def wrong(dataset: Dataset, table: Made) -> Iterator[str]:
    """Columns that were not read as they were written."""
    return differing(dataset.tables[f"{table.kind}.csv"], table.values)


#: Columns of coupon.csv by the names they have once they are read.
_OF_COUPONS = {"t": "time", "nominal_stress": "stress", "temperature_C": "celsius"}


def differing(read: Sheet | Coupons, meant: Mapping[str, Sequence[float | str]]) -> Iterator[str]:
    """Columns whose SI values or texts are not those that are meant; "rows" if their count is not.

    Optional columns that were not read differ from nothing.
    """
    if {len(read)} != {len(values) for values in meant.values()}:
        yield "rows"
        return
    for name, values in meant.items():
        got = getattr(read, _OF_COUPONS.get(name, name) if isinstance(read, Coupons) else name)
        if got is not None and any(_differs(*pair) for pair in zip(got, values, strict=True)):
            yield name


def _differs(read: float | str, meant: float | str) -> bool:
    """Whether a cell that was read is another than the one meant."""
    if isinstance(meant, str):
        return read not in ("", meant)
    return abs(float(read) - meant) > 1e-9 * abs(meant)  # False of nan: nothing was read


def main() -> None:
    """Count tables read at once, read after advice, read wrongly and given up."""
    count, seed = (int(word) for word in [*sys.argv[1:], "30", "1"][:2])
    counts = Counter[str]()
    for number in range(seed, seed + count):
        table = made(number)
        with tempfile.TemporaryDirectory() as folder:
            try:
                dataset, written = followed(Path(folder), table)
                bad = list(wrong(dataset, table))
                said = f"WRONG {bad}" if bad else f"read after {len(written)} lines"
            except InputError as error:
                said = f"GIVEN UP {error}"
        counts[said.partition(" {")[0][:20]] += 1
        print(number, *table.features, said)
    print(dict(counts))


if __name__ == "__main__":
    main()
