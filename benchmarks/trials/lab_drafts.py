"""Tables as laboratories have them: what a draft makes of each, and whether anything is silent.

``python -m benchmarks.trials.lab_drafts [WORD]`` makes the draft of each table in ``lab_tables/``,
of those whose name, file or group has the WORD, and reads it twice: as it is, and with every
marked line as the writer of the table means it. What was read is compared with what the writer
means.
"""

from __future__ import annotations

import io
import re
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, time
from pathlib import Path
from typing import Any

from benchmarks.trials.tables import SPECIMEN, differing
from tympan.base.errors import InputError
from tympan.studies.data.checks import slips_of_sign, slips_of_unit
from tympan.studies.data.dataset import FILES, GUESS, Dataset, read_dataset
from tympan.studies.data.draft import write_draft

#: The tables, several in each file.
TABLES = Path(__file__).parent / "lab_tables"
#: A line of a draft that states something, perhaps without effect.
_LINE = re.compile(r"#? ?(?P<key>\w+)\b(?: =|:)")
#: Words of a message that says what to do.
_ADVISES = re.compile(r"\b(write|call|give|say|state|save|convert|name|split|add|put|leave out)\b")

RIGHT, MARKED = "right", "marked"
REFUSED, UNADVISED = "refused with advice", "refused without advice"
SILENT = "SILENTLY WRONG"
#: What may be said of a table, in the order of the counts.
VERDICTS = (RIGHT, MARKED, REFUSED, UNADVISED, SILENT)
#: Keys of a draft, and the columns that they are about.
_ABOUT = {"area": "nominal_stress", "length": "stretch", "file": "specimen", "skip_lines": "rows",
          "missing": "rows", "fill": "rows"}


@dataclass(frozen=True)
class LabTable:
    """A table of a laboratory.

    ``films``: names of the specimens whose files stand beside it; ``kind``: the file of a dataset
    it stands for; ``meant``: its values by column, SI; ``answers``: lines the writer puts in place
    of marked ones, by column or key; ``unstatable``: what no line can state, so that whoever sees
    the mark has to change the table; ``group``: the file of ``lab_tables/`` it is in.
    """

    name: str
    file: str
    content: bytes
    films: tuple[str, ...]
    kind: str
    meant: Mapping[str, Sequence[float | str]]
    answers: Mapping[str, str]
    unstatable: frozenset[str]
    group: str


@dataclass(frozen=True)
class Judged:
    """A verdict on the draft of a table, why, and how many of its lines are marked."""

    verdict: str
    why: str = ""
    marks: int = 0

    @property
    def line(self) -> str:
        marks = f"{self.marks} mark{'s' if self.marks != 1 else ''}" if self.marks else ""
        return f"{self.verdict:22s} {marks:8s} {self.why}".rstrip()


def lab_tables() -> list[LabTable]:
    """All tables."""
    return [_table(entry, file.stem) for file in sorted(TABLES.glob("*.toml"))
            for entry in tomllib.loads(file.read_text("utf-8"))["table"]]


def _table(entry: Mapping[str, Any], group: str) -> LabTable:
    (kind, meant), = entry["meant"].items()
    rows = max(len(values) for values in meant.values() if isinstance(values, list))
    answers = dict(entry.get("answers", {}))
    unstatable = frozenset(answers.pop("unstatable", ()))
    content = (_workbook(entry["sheets"]) if "sheets" in entry
               else entry["text"].encode(entry.get("encoding", "utf-8")))
    return LabTable(entry["name"], entry["file"], content, tuple(entry["films"]), kind,
                    dict(_si(kind, title, values, rows) for title, values in meant.items()),
                    answers, unstatable, group)


def _si(kind: str, title: str, values: Any, rows: int) -> tuple[str, list[float | str]]:
    """Name and SI values of a column by its title."""
    column = next(column for column in FILES[f"{kind}.csv"] if column.claims(title))
    every = values if isinstance(values, list) else [values] * rows
    return column.name, [value if isinstance(value, str) else value * column.factor(title)
                         for value in every]


def _workbook(sheets: Mapping[str, str]) -> bytes:
    """A workbook of sheets whose cells are given with tabs between them."""
    from openpyxl import Workbook

    book, content = Workbook(), io.BytesIO()
    del book["Sheet"]
    for name, text in sheets.items():
        sheet = book.create_sheet(name)
        for line in text.strip().splitlines():
            sheet.append([_cell(cell) for cell in line.split("\t")])
    book.save(content)
    return content.getvalue()


def _cell(text: str) -> Any:
    """A cell as Excel has it: a number, a date, a time, a text or nothing."""
    for read in (float, date.fromisoformat, time.fromisoformat):
        try:
            return read(text)  # type: ignore[operator]
        except ValueError:
            pass
    return text or None


def judged(table: LabTable, folder: Path) -> Judged:
    """The verdict on a table's draft in an empty folder."""
    folder.mkdir(exist_ok=True)
    (folder / table.file).write_bytes(table.content)
    entry = SPECIMEN.replace("[[specimen]]\n", "").replace("[specimen.", "[")
    for film in table.films:
        (folder / f"{film}.toml").write_text(entry.replace('"circle"', f'"{film}"', 1), "utf-8")
    try:
        text = _drafted(table, folder)
    except InputError as error:
        return _refused(error)
    marked = dict(_marks(text, table.kind))
    as_is = Reading.of(table, folder, text)
    if as_is.faults - marked.keys() - as_is.warned:
        return Judged(SILENT, as_is.said, text.count(GUESS))
    if not as_is.faults and as_is.refusal is None:
        return Judged(RIGHT, as_is.said, text.count(GUESS))
    if "kind" in marked and f"[columns.{table.kind}]" not in text:
        text = _drafted(table, folder, table.answers.get("kind"))
        marked = dict(_marks(text, table.kind))
    corrected = Reading.of(table, folder, _corrected(text, marked, table))
    allowed = table.unstatable & (marked.keys() | corrected.warned)
    if corrected.faults - allowed - corrected.warned:
        return Judged(SILENT, f"once corrected: {corrected.said}", text.count(GUESS))
    if allowed & marked.keys():
        return Judged(MARKED, f"the table has to be changed: {', '.join(sorted(allowed))}",
                      text.count(GUESS))
    if corrected.refusal is not None:
        return _refused(corrected.refusal, text.count(GUESS))
    warned = corrected.faults & corrected.warned
    return Judged(MARKED, f"warned of: {', '.join(sorted(warned))}" if warned else corrected.said,
                  text.count(GUESS))


def _drafted(table: LabTable, folder: Path, kind: str | None = None) -> str:
    target = folder / "dataset.toml"
    target.unlink(missing_ok=True)
    return write_draft(folder / table.file, kind=kind).read_text("utf-8")


def _refused(error: InputError, marks: int = 0) -> Judged:
    return Judged(REFUSED if _ADVISES.search(error.allowed) else UNADVISED, str(error), marks)


@dataclass(frozen=True)
class Reading:
    """What was read of a draft.

    ``faults``: columns that are not as they were meant, "rows" where there are more or fewer,
    "kind" where another file of a dataset is read; ``warned``: those that ``tympan data`` warns
    about; ``lost``: columns that were meant and not read; or the ``refusal``.
    """

    faults: frozenset[str] = frozenset()
    warned: frozenset[str] = frozenset()
    lost: tuple[str, ...] = ()
    refusal: InputError | None = None

    @classmethod
    def of(cls, table: LabTable, folder: Path, text: str) -> Reading:
        """What is read of the text of a dataset.toml."""
        (folder / "dataset.toml").write_text(text, "utf-8")
        try:
            dataset = read_dataset(folder)
        except InputError as error:
            return cls(refusal=error)
        read = dataset.tables.get(f"{table.kind}.csv")
        if read is None:
            return cls(frozenset(("kind",)))
        faults = frozenset(differing(read, table.meant))
        lost = [name for name in table.meant if "rows" not in faults
                and list(differing(read, {name: [_other(value) for value in table.meant[name]]}))
                == []]
        return cls(faults, frozenset(_warned(dataset, table)), tuple(lost))

    @property
    def said(self) -> str:
        """What is wrong, or was not read."""
        if self.refusal is not None:
            return str(self.refusal)
        wrong = f"wrong: {', '.join(sorted(self.faults))}" if self.faults else ""
        lost = f"not read: {', '.join(self.lost)}" if self.lost else ""
        return "; ".join(filter(None, (wrong, lost)))


def _other(value: float | str) -> float | str:
    """Another value than this one, which only a column that was not read does not contradict."""
    return f"not {value}" if isinstance(value, str) else 2 * value + 1


def _warned(dataset: Dataset, table: LabTable) -> Iterator[str]:
    """Columns that a warning of ``tympan data`` is about."""
    if any(re.search("lines are left out|only the sheet", words) for words in dataset.remarks):
        yield "rows"
    if list(slips_of_sign(dataset)):
        yield "displacement"
    for slip in slips_of_unit(dataset):
        yield from (name for name in table.meant if f"largest {name} of" in slip)
        if "stretches" in slip:
            yield "stretch"


def _marks(text: str, kind: str) -> Iterator[tuple[str, str]]:
    """Marked lines of a draft by the column or the key that they are about."""
    columns = FILES[f"{kind}.csv"]
    for line in text.splitlines():
        if GUESS not in line:
            continue
        stated = _LINE.match(line)
        key = "kind" if line.startswith(f"# {GUESS}") or stated is None else stated["key"]
        key = "rows" if key == "kind" and "only the sheet" in line else key
        yield next((column.name for column in columns if column.claims(key)), key), line
        if key in _ABOUT:
            yield _ABOUT[key], ""


def _corrected(text: str, marked: Mapping[str, str], table: LabTable) -> str:
    """A draft with the writer's lines in place of marked ones, which are kept if there is none."""
    for name, line in marked.items():
        if not line or name == "kind":  # its answer is that of the command
            continue
        kept = line.partition("  # ")[0] if not line.startswith("#") else ""
        text = text.replace(f"{line}\n", f"{table.answers.get(name, kept)}\n")
    return text


def main() -> int:
    """A line for each table, and counts; 1 where one is silently wrong."""
    word = sys.argv[1] if len(sys.argv) > 1 else ""
    counts = Counter[str]()
    for table in lab_tables():
        if word not in table.name + table.file + table.group:
            continue
        with tempfile.TemporaryDirectory() as folder:
            verdict = judged(table, Path(folder))
        counts[verdict.verdict] += 1
        print(f"{table.file:22.22s} {table.name:60.60s} {verdict.line}", flush=True)
    print("; ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS))
    return int(counts[SILENT] > 0)


if __name__ == "__main__":
    sys.exit(main())
