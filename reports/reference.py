"""The page docs/reference.md: every key of files that a user writes.

It is made from the declarations of the fields. ``python -m tympan.reports.reference >
docs/reference.md`` writes it anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import is_dataclass
from typing import Any, Literal, get_args, get_origin

from tympan.base.fields import Field, Registry, fields_of
from tympan.base.toml_reader import FINITE
from tympan.base.units import DIMENSIONS, quantity_text
from tympan.fem.film.breakdown import STRENGTH_LIBRARY
from tympan.fem.film.laws import LAWS
from tympan.fem.film.library import MATERIALS
from tympan.fem.membrane.biases import BIASES
from tympan.fem.rig import Actuator, Rig
from tympan.geometry.outlines import OUTLINES, Rotated
from tympan.geometry.outlines.pieces import PIECES
from tympan.geometry.specimen import (
    FLOWS,
    STRENGTHS,
    Electrode,
    Film,
    Plate,
    Region,
    ViscousBranch,
)
from tympan.reports.template import template
from tympan.studies import wanted
from tympan.studies.data.dataset import Dataset
from tympan.studies.data.effort import Effort
from tympan.studies.design.requirements import RequirementsFile, SoldFilm
from tympan.studies.effects import EFFECTS, listing
from tympan.studies.limits.loads import LoadGrid
from tympan.studies.study import StudyFile
from tympan.studies.sweep.asked import QUESTIONS
from tympan.studies.sweep.plan import Sample, SweepFile
from tympan.studies.tolerance.given import (
    LengthScatter,
    Scatter,
    StrengthScatter,
    Tolerances,
)
from tympan.tables.layouts import Layout, Stated

#: Sections that list the kinds of a table.
_SECTIONS: tuple[tuple[str, Registry[Any]], ...] = (
    ("Outlines", OUTLINES), ("Pieces of drawn outlines", PIECES), ("Laws", LAWS),
    ("Strengths", STRENGTHS), ("Flows", FLOWS), ("Bias mechanisms", BIASES))


def page(rig: type[Rig] = Rig) -> str:
    """Write the page's text; ``rig`` is the rig whose keys it lists."""
    tables = (("specimen.toml", Actuator), ("[frame], [plate]: any outline, turned", Rotated),
              ("[plate]", Plate), ("[membrane]", Film),
              ("[[membrane.branch]]: any flow, and", ViscousBranch), ("[electrode]", Electrode),
              ("[electrode.outline]", Region), ("rig.toml", rig),
              ("TOLERANCES.toml", Tolerances), ("[thickness] and other shares", Scatter),
              ("[frame], [plate], [offset], [margin]", LengthScatter),
              ("[strength]", StrengthScatter),
              ("REQUIREMENTS.toml", RequirementsFile), ("[[film]] of requirements", SoldFilm),
              ("STUDY.toml", StudyFile), ("[curves], [alpha_fit] of a study", LoadGrid),
              ("SWEEP.toml", SweepFile), ("[sample] of a sweep", Sample),
              ("dataset.toml", Dataset), ("[effort] of a dataset", Effort),
              ("[columns.static] and others of dataset.toml", Layout),
              ("a column there, by its name with the unit of the file's numbers", Stated))
    return template("reports/reference.txt", summary=_summary, named=listing.named).render(
        tables=tables, sections=_SECTIONS, rows=_rows, effects=EFFECTS, questions=QUESTIONS,
        wanted=wanted.QUANTITIES.known,
        libraries={"Laws": tuple(MATERIALS), "Strengths": tuple(STRENGTH_LIBRARY)})


def _summary(cls: type) -> str:
    return (cls.__doc__ or "").split("\n\n")[0].replace("\n", " ").replace("``", "`")


def _rows(cls: type) -> Iterator[list[str]]:
    for field in fields_of(cls):
        if not field.says.inline and not (cls is Rotated and field.says.kinds):
            cells = (f"`{field.key}`", _form(field), _default(field), _limits(field),
                     field.says.meaning + _instead(field))
            yield [cell.replace("|", "&#124;") for cell in cells]


def _instead(field: Field) -> str:
    """List the keys that may replace it."""
    words = " and ".join(f"`{word}`" for word in field.says.doubled)
    return f"; or {words}, twice as much" if words else ""


def _form(field: Field) -> str:
    """Describe the kind of value that a field holds."""
    if field.kind is Any:
        return "quantity"
    title = next((title for title, kinds in _SECTIONS if kinds is field.says.kinds), "")
    if title or is_dataclass(field.item):
        what = "tables" if field.several else "table"
        return f"{what}: [{title}](#{title.lower().replace(' ', '-')})" if title else what
    if get_origin(field.item) is Literal:
        return " or ".join(f'"{name}"' for name in get_args(field.item))
    words = {str: "text", int: "whole number", bool: "true or false"}
    unit = DIMENSIONS[field.says.dimension].symbol if field.says.dimension else ""
    what = f"{field.says.dimension} [{unit}]" if unit else words.get(field.item, "number")
    if not field.several:
        return what
    count = f"{field.count} ×" if field.count else "list of"
    points = "points, 2 × " if get_origin(field.item) is tuple else ""
    return f"{count} {points}{what}"


def _default(field: Field) -> str:
    if field.required:
        return "required"
    return field.says.default or _shown(field, field.default)


def _shown(field: Field, value: Any) -> str:
    if is_dataclass(value):
        return "all defaults"
    if value in (None, ()):
        return "none"
    if isinstance(value, tuple):
        return ", ".join(_shown(field, part) for part in value)
    if isinstance(value, str | bool) or not field.says.dimension:
        return f"{value:g}" if isinstance(value, float) else str(value)
    return quantity_text(value, field.says.dimension)


def _limits(field: Field) -> str:
    needs = f"only with `{field.says.needs}`" if field.says.needs else ""
    least = f"at least {field.says.least}" if field.says.least > 1 else ""
    rule = field.says.rule[1] if field.says.rule is not FINITE else ""
    return "; ".join(filter(None, (rule, least, needs)))


if __name__ == "__main__":
    print(page(), end="")
