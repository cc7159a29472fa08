"""Table 1 as it survived, and what the rest of tympan has borrowed from it."""

from __future__ import annotations

import pytest

from tests.support.specimens import circular
from tympan.base.errors import InputError
from tympan.paper.table1 import TABLE_1, VISCOUS, known
from tympan.studies.lumped.actuator import BORROWED
from tympan.studies.lumped.eq8 import eq8


def test_table_1_marks_what_is_lost() -> None:
    missing = {symbol for symbol, cell in TABLE_1.items() if "value" not in cell}
    assert missing == {"g", "alpha_1", "alpha_2", "epsilon_0", "epsilon_r"}
    assert all(TABLE_1[symbol]["note"] for symbol in missing)
    with pytest.raises(InputError, match="lost"):
        known("epsilon_r")
    law = eq8(circular(), 8.0).membrane.material
    cells = {symbol: cell.get("value") for symbol, cell in TABLE_1.items()}
    assert law.beta == tuple(cells[f"beta_{i}"] for i in (1, 2, 3))
    assert law.gamma == tuple(cells[f"gamma_{i}"] for i in (1, 2, 3))


def test_borrowed_constants_are_the_papers() -> None:
    assert BORROWED == VISCOUS
    assert BORROWED.borrowed
