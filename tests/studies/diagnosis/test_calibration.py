"""Readings that a nominal fit leaves out, as no film can show them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tympan.studies.diagnosis import calibration
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows


def test_the_highest_voltages_are_left_out_where_no_reading_is_to_blame(
        monkeypatch: pytest.MonkeyPatch) -> None:
    """Each state has an equilibrium by itself, but no film has one at all of them from 5 kV on."""
    voltages = np.repeat([0.0, 2e3, 3e3, 4e3, 5e3, 6e3], 2)
    states = States.of(np.zeros(len(voltages), int), np.full(len(voltages), 0.02), voltages)
    table = rows(states, "displacement", 1e-5, np.linspace(2e-3, 4e-3, len(voltages)))
    asked = list[float]()

    def fitted(simulation: Any, table: ReadingTable) -> Any:
        asked.append(float(table.voltage.max()))
        assert len(set(asked)) == len(asked), "asked again with the same readings"
        return SimpleNamespace(possible=asked[-1] < 5e3, unknowns=np.zeros(2))

    def predicted(simulation: Any, hypothesis: Any, unknowns: Any, table: ReadingTable) -> Any:
        return SimpleNamespace(impossible_rows=np.zeros(len(table), bool),
                               short=np.zeros(len(table.states), bool))

    monkeypatch.setattr(calibration, "_safest", lambda *given: SimpleNamespace(unknowns=None))
    monkeypatch.setattr(calibration, "nominal_fit", fitted)
    monkeypatch.setattr(calibration, "Prediction", predicted)
    reasons = calibration._reasons(cast(Any, None), table)
    assert asked == [6e3, 5e3, 4e3]
    assert (reasons != "").tolist() == (voltages >= 5e3).tolist()
    assert set(reasons[-4:].tolist()) == {"a film that fits the other readings has no equilibrium "
                                          "there"}
