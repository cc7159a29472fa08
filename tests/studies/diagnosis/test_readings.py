"""Rows of a dataset as they are judged."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.datasets import write_dataset
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.readings import prepared_readings


def test_a_tilt_has_no_sign_but_for_its_noise(tmp_path: Path) -> None:
    """Films tilt either way by chance; a sign of what noise makes would look like a tilt."""
    tilts = (-5.0, 5.0, -0.02, 0.02, -3.0, 2.0)
    lines = [f"A,18,{number},{2 + 0.1 * number},{tilt}" for number, tilt in enumerate(tilts)]
    written = write_dataset(tmp_path / "data", specimens=("A",), static="\n".join([
        "specimen,mass_g,voltage_kV,displacement_mm,tilt_mrad", *lines]) + "\n")
    table = prepared_readings(read_dataset(written)).table
    read = 1e3 * table.value[table.kind == "tilt"]
    assert read == pytest.approx([5.0, 5.0, -0.02, 0.02, 3.0, 2.0])
