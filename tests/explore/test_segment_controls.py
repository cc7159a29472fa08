"""Sliders of a film with segments: a voltage for each of them."""

from __future__ import annotations

import pytest

from tests.support.specimens import circular, quarters
from tympan.base.errors import InputError
from tympan.explore.view import FilmView, changed, control_value, controls

KEYS = [f"electrode.segments.{number}.voltage" for number in range(4)]


def volts(view: FilmView) -> list[float]:
    return [control_value(view, key) for key in KEYS]


def test_a_segment_has_a_slider_in_kilovolts() -> None:
    found = {control.key: control for control in controls(FilmView(quarters(1e-3), voltage=2e3))}
    assert [found[key].label for key in KEYS] == [f"voltage of {name}" for name in "ABCD"]
    assert {found[key].unit for key in KEYS} == {"kV"}
    assert not any("share" in key for key in found)
    assert not any("segments" in control.key for control in controls(FilmView(circular())))


def test_a_segment_s_voltage_leaves_the_others() -> None:
    """The film's voltage is the highest one."""
    view = changed(FilmView(quarters(1e-3)), KEYS[0], 3e3)
    assert volts(view) == [3e3, 0, 0, 0]
    view = changed(view, KEYS[1], 1e3)
    assert volts(view) == pytest.approx([3e3, 1e3, 0, 0])
    assert view.voltage == 3e3
    view = changed(view, KEYS[1], 4e3)
    assert volts(view) == pytest.approx([3e3, 4e3, 0, 0])
    assert view.voltage == 4e3
    view = changed(view, "voltage", 2e3)
    assert volts(view) == pytest.approx([1.5e3, 2e3, 0, 0])
    view = changed(view, KEYS[1], 0.0)
    assert volts(view) == pytest.approx([1.5e3, 0, 0, 0])
    with pytest.raises(InputError, match="voltage"):
        changed(view, KEYS[2], -1.0)
