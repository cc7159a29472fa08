"""Published formats of coupon tests, which are recognised by more than the suffix of a file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from tympan.base.errors import InputError
from tympan.studies.data.coupon import MODES, OF_MODE
from tympan.tables.formats import (
    FORMATS,
    Format,
    Row,
    decimal_point,
    decoded,
    first_line,
    text_rows,
)

#: First lines of digitised tables of VHB tape. Besides stretch and stress [Pa] a table may have
#: temperatures [K], times [s], rates of the stretch [1/s] and voltages [V].
_DIGITISED = (
    "id stretch stress",
    "id stretch stress rate",
    "id description temp stretch stress",
    "id description temp stretch time stress",
    "id description temp vel stretch stress",
    "id description temp voltage vel stretch stress",
)
#: Columns of a digitised table that are taken over into coupon.csv under another name.
_RENAMED = {"stretch": "stretch", "stress": "nominal_stress_Pa", "time": "t_s",
            "voltage": "voltage_V"}
_RATES = ("vel", "rate")
_ICE = 273.15

_PAIR = re.compile(r"\s*[-+.\d][-+.\deE]*\s+[-+.\d][-+.\deE]*\s*", re.ASCII)


def _named_mode(file: Path) -> tuple[str, str] | None:
    """Split a file's name into the part before the mode it ends with, and that mode."""
    match = OF_MODE.fullmatch(file.stem)
    return (match["specimen"], match["mode"].lower()) if match else None


def _is_pairs(file: Path, content: bytes) -> bool:
    return _named_mode(file) is not None and _PAIR.fullmatch(first_line(content)) is not None


def pair_rows(file: Path, content: bytes) -> list[Row]:
    """Read rows of lines with a nominal stress in MPa and a stretch, without headings."""
    specimen, mode = _named_mode(file) or ("", "")
    rows: list[Row] = [(1, ["specimen", "mode", "nominal_stress_MPa", "stretch"])]
    for number, line in enumerate(decoded(content, file).split("\n"), start=1):
        if line.strip():
            rows.append((number, [specimen, mode, *line.split()]))
    return rows


def _is_digitised(file: Path, content: bytes) -> bool:
    return " ".join(re.split("[;,\t]", first_line(content).strip())) in _DIGITISED


def digitised_rows(file: Path, content: bytes) -> list[Row]:
    """Read a digitised table: a run for each id, uniaxial unless the file's name has a mode.

    In a test at a rate, the time is the path of the stretch over the rate.
    """
    (top, titles), *below = text_rows(file, content)
    mode = (_named_mode(file) or ("", "uniaxial"))[1]
    names = [_RENAMED[title] for title in titles if title in _RENAMED]
    places = [place for place, title in enumerate(titles) if title in _RENAMED]
    times = _times(file, titles, below)
    warm = titles.index("temp") if "temp" in titles else None
    rows: list[Row] = [(top, ["mode", "run", *names, *(["t_s"] if times else []),
                              *(["temperature_C"] if warm is not None else [])])]
    for number, (line, cells) in enumerate(below):
        _check_width(file, line, cells, titles)
        more = [f"{times[number]:.12g}"] if times else []
        if warm is not None:
            more.append(f"{_number(file, line, titles, cells, 'temp') - _ICE:.10g}")
        run = f"{file.stem} {cells[titles.index('id')]}"
        rows.append((line, [mode, run, *(cells[place] for place in places), *more]))
    return rows


def _times(file: Path, titles: Sequence[str], below: Sequence[Row]) -> list[float]:
    """Compute times of the readings of a table with rates [s]; empty for one without rates."""
    rate = next((title for title in titles if title in _RATES), None)
    return [] if rate is None else list(_passed(file, titles, below, rate))


def _passed(file: Path, titles: Sequence[str], below: Sequence[Row], rate: str
            ) -> Iterator[float]:
    time, before, test = 0.0, 0.0, None
    for line, cells in below:
        _check_width(file, line, cells, titles)
        stretch, speed = (_number(file, line, titles, cells, name) for name in ("stretch", rate))
        if speed <= 0:
            raise _error(file, line, titles, cells, rate, "must be positive")
        if cells[titles.index("id")] != test:
            time, before, test = 0.0, stretch, cells[titles.index("id")]
        time += abs(stretch - before) / speed
        before = stretch
        yield time


def _check_width(file: Path, line: int, cells: Sequence[str], titles: Sequence[str]) -> None:
    if len(cells) != len(titles):
        raise InputError(f"must have {len(titles)} cells, as the first line has", file=file,
                         key=f"line {line}", given=f"{len(cells)} cells")


def _number(file: Path, line: int, titles: Sequence[str], cells: Sequence[str], name: str
            ) -> float:
    try:
        return float(decimal_point(cells[titles.index(name)]))
    except ValueError:
        raise _error(file, line, titles, cells, name, "must be a number") from None


def _error(file: Path, line: int, titles: Sequence[str], cells: Sequence[str], name: str,
           allowed: str) -> InputError:
    place = titles.index(name)
    return InputError(allowed, file=file, given=cells[place],
                      key=f"line {line}, column {place + 1} ({name})")


FORMATS.register(Format(
    ".csv", "digitised tests of VHB tape by id: stress in Pa, temp in K, time in s, vel or rate in "
    "1/s, voltage in V; uniaxial unless the file's name ends with a mode", digitised_rows,
    "digitised coupons", _is_digitised, "coupon.csv"))
FORMATS.register(Format(
    ".txt", "pairs of nominal stress in MPa and stretch without names of columns, in files whose "
    f"names end with {', '.join(MODES)}", pair_rows, "coupon pairs", _is_pairs, "coupon.csv"))
