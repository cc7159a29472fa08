"""A film that no such film is: what was taken for something else is named.

Readings are those of exact axisymmetric membranes (design values), none made by this program.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.datasets import HEAD, write_dataset
from tests.support.trials import design, read
from tympan.geometry.specimen import Specimen
from tympan.studies.data.dataset import Dataset, read_dataset
from tympan.studies.diagnosis.calibration import calibrated
from tympan.studies.diagnosis.explanations.quantities import Confusion, confusions_of
from tympan.studies.diagnosis.explanations.registry import explanation_of
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.verdict import UNUSUAL, judge
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.diagnosis.reduced.simulation import Simulation

#: Deflections [mm] of neo-Hookean films of 20 kPa under 17.9 g and 22.45 g at these voltages [kV].
EXACT = {17.9: (2.1185, 2.4307, 2.8717, 4.3843), 22.45: (2.6569, 3.0484, 3.6018, 5.5194)}
VOLTAGES = (0.0, 3.5, 5.0, 7.0)


def dataset(folder: Path, length: float = 1.0, load: float = 1.0, noise: str = "10 um") -> Dataset:
    """With deflections and loads written in other units than their columns say."""
    generator = np.random.default_rng(1)
    rows = "".join(f"A,{load * mass},{kv},{length * (read + 0.01 * generator.normal()):.6f}\n"
                   for mass, reads in EXACT.items()
                   for kv, read in zip(VOLTAGES, reads, strict=True) for _ in range(2))
    head = HEAD + f'noise = "{noise}"\n' if noise else HEAD
    written = write_dataset(folder, head, ("A",),
                            static="specimen,mass_g,voltage_kV,displacement_mm\n" + rows)
    about = written / "dataset.toml"
    text = about.read_text().replace(
        'material = "vhb-4910"', '[specimen.membrane.material]\nlaw = "neo_hooke"\nmu = "20 kPa"')
    about.write_text(text)
    return read_dataset(written)


def named(made: Dataset) -> tuple[float, list[tuple[str, str]]]:
    """How usual the fitted factors are, and what is named."""
    readings = prepared_readings(made)
    fitted = calibrated(readings.setup, readings.table).fit
    return fitted.usual, [(one.of, one.taken) for one in confusions_of(made, readings, fitted)]


def test_an_exact_film_is_ordinary(tmp_path: Path) -> None:
    readings = prepared_readings(dataset(tmp_path / "data"))
    assert calibrated(readings.setup, readings.table).fit.usual > 0.5


@pytest.mark.parametrize(("length", "load", "words"), [
    (0.1, 1.0, ("displacement_mm of static.csv", "in centimetres")),
    (1.0, 9.80665, ("mass_g of static.csv", "in millinewtons"))])
def test_units_are_named(tmp_path: Path, length: float, load: float, words: tuple[str, str]
                         ) -> None:
    usual, read = named(dataset(tmp_path / "data", length, load))
    assert usual < UNUSUAL
    assert read == [words]


def test_large_deflections_tell_a_length_from_a_load_where_no_noise_is_stated(tmp_path: Path
                                                                              ) -> None:
    _, read = named(dataset(tmp_path / "data", length=0.1, noise=""))
    assert read[0] == ("displacement_mm of static.csv", "in centimetres")


def mapped(folder: Path, unit: str) -> Dataset:
    """The same rows under somebody's German headings, with the unit of the way given."""
    table = folder / "static.csv"
    _, *rows = table.read_text().splitlines()
    table.write_text("\n".join([f"Probe,Gewicht [g],Spannung [kV],Weg [{unit}]", *rows]) + "\n")
    about = folder / "dataset.toml"
    about.write_text(about.read_text() + f"""
[columns.static]
specimen = "Probe"
mass_g = "Gewicht [g]"
voltage_kV = "Spannung [kV]"
displacement_{unit} = {{ from = "Weg [{unit}]", sign = "down" }}
""")
    return read_dataset(folder)


def test_the_unit_of_a_mapped_column_is_that_of_its_key(tmp_path: Path) -> None:
    """No unit is read from its heading again."""
    dataset(tmp_path / "data", 0.1)
    made = mapped(tmp_path / "data", "mm")
    assert named(made)[1] == [("Weg [mm] of static.csv", "in centimetres")]


def test_displacements_from_the_loaded_plate_are_named(tmp_path: Path) -> None:
    """Films that nothing pulls down without voltage are none."""
    dataset(tmp_path / "data")
    table = tmp_path / "data" / "static.csv"
    head, *rows = table.read_text().splitlines()
    first = {str(mass): reads[0] for mass, reads in EXACT.items()}
    cells = [row.split(",") for row in rows]
    table.write_text("\n".join([head, *(
        f"{film},{mass},{kv},{float(read) - first[mass]:.6f}" for film, mass, kv, read in cells)])
        + "\n")
    made = read_dataset(tmp_path / "data")
    readings = prepared_readings(made)
    fitted = calibrated(readings.setup, readings.table).fit
    assert fitted.usual < UNUSUAL
    assert confusions_of(made, readings, fitted)[0] == Confusion(
        "displacement_mm of static.csv", "it were counted from the loaded plate without voltage",
        "do_zero")


@pytest.mark.parametrize(("edit", "of"), [
    (lambda one: replace(one, membrane=replace(one.membrane, thickness=0.2e-3)),
     "membrane.thickness"),
    pytest.param(lambda one: replace(one, membrane=replace(one.membrane, prestretch=(5.0, 5.0))),
                 "membrane.prestretch", marks=pytest.mark.study)])
def test_specimens_written_wrongly_are_named(tmp_path: Path, of: str,
                                             edit: Callable[[Specimen], Specimen]) -> None:
    made = dataset(tmp_path / "data")
    usual, read = named(replace(made, specimens=tuple(map(edit, made.specimens))))
    assert usual < UNUSUAL
    assert read[0][0] == of


def test_such_factors_are_never_nothing(three_shapes: Simulation) -> None:
    """However well they fit: a tenth of every deflection."""
    table = read(three_shapes, design(2e-6), (), [], 1)
    small = table.with_values(0.1 * table.value)
    judged = judge(three_shapes, small, [Cause("sensor_zero"), Cause("unaccounted_mass")])
    assert judged.verdict == "unexplained"
    assert judged.unusual
    found = explanation_of(judged)
    assert found is not None
    assert found.finding is not None
    assert found.finding.kind == "film"
    assert found.what == found.finding.what
    assert "times as stiff as stated" in found.what
