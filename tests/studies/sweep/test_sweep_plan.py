"""SWEEP.toml: what it makes of its keys, what it refuses, and what a case's id depends on."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.specimens import specimen_toml
from tests.support.sweeps import CHEAP, read, written
from tympan.base.errors import InputError
from tympan.base.units import RANGE
from tympan.cli import main
from tympan.fem.film.laws import NeoHooke
from tympan.fem.rig import Rig
from tympan.geometry.cad.membrane import membrane_part
from tympan.geometry.cad.parts import write_dxf
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Film, Specimen
from tympan.studies.sweep.asked import Ask
from tympan.studies.sweep.plan import read_sweep
from tympan.studies.sweep.task import SweepTask

LOADS = 'specimen = "oval.toml"\nmass = "17.9 g"\nvoltage = "1 kV"\n'


def tasks(folder: Path, text: str, **files: str) -> list[SweepTask]:
    planned = [entry.task for entry in read(folder, text, **files).entries]
    assert all(task is not None for task in planned)
    return [task for task in planned if task is not None]


def test_grid_list_and_sample_multiply(tmp_path) -> None:
    planned = tasks(tmp_path, LOADS + """[grid]
"membrane.relative_permittivity" = [4.7, 3]
"frame.semi_axes" = [["6 cm", "4.5 cm"], ["7.5 cm", "4.5 cm"]]
[list]
"plate.radius" = ["1 cm", "12 mm", "15 mm"]
"rig.spring" = ["1 N/m", "2 N/m", "3 N/m"]
[sample]
method = "latin_hypercube"
count = 5
[sample.ranges]
"membrane.thickness" = ["0.5 mm", "1 mm"]
""")
    assert len({task.id for task in planned}) == len(planned) == 2 * 2 * 3 * 5
    assert {(task.specimen.plate.outline.radius, task.rig.spring) for task in planned} == {
        (0.01, 1.0), (0.012, 2.0), (0.015, 3.0)}
    thickness = np.unique([task.specimen.membrane.thickness for task in planned])
    assert np.array_equal(np.floor((thickness - 0.5e-3) / 0.1e-3),
                          np.arange(5))  # one in each fifth


def test_loads_may_be_varied_with_the_specimen(tmp_path) -> None:
    text = ('specimen = "oval.toml"\nvoltage = ["0 kV", "1 kV"]\n'
            '[list]\nmass = ["1 g", "2 g"]\n"plate.radius" = ["8 mm", "9 mm"]')
    assert [task.masses for task in tasks(tmp_path, text)] == [(1e-3,), (2e-3,)]


def test_a_film_without_plate_needs_no_mass(tmp_path) -> None:
    bare = specimen_toml().replace('[plate]\nshape = "circle"\nradius = "1 cm"\n', "")
    text = 'specimen = "oval.toml"\nvoltage = "1 kV"\nrig = { gas_pressure = "50 Pa" }\n'
    assert [task.masses for task in tasks(tmp_path / "bare", text, oval=bare)] == [(0.0,)]
    for more in ("", '[grid]\n"plate.shape" = ["circle"]\n"plate.radius" = ["8 mm"]'):
        film = bare if more else specimen_toml()
        with pytest.raises(InputError, match=r"SWEEP.toml: mass: is missing"):
            read(tmp_path / "with a plate", text + more, oval=film)


CHANGES = {
    "material": ('"vhb-4910"', '"vhb-4910-gent"'), "frame": ("6 cm", "6.1 cm"),
    "plate": ("1 cm", "1.1 cm"),
    "thickness": ("1 mm", "1.1 mm"), "prestretch": ("2.236,", "2.2361,"),
    "permittivity": ("4.7", "4.71"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_ids_follow_every_number_of_the_specimen(tmp_path, change: str) -> None:
    [task] = tasks(tmp_path / "a", LOADS)
    [other] = tasks(tmp_path / "b", LOADS, oval=specimen_toml().replace(*CHANGES[change]))
    assert task.id != other.id
    assert not set(task.ids) & set(other.ids)


def test_ids_follow_loads_rig_settings_and_solver_but_not_names_or_units(tmp_path) -> None:
    [task] = tasks(tmp_path / "a", LOADS)
    for changed in (replace(task, masses=(1e-3,)), replace(task, voltages=(2e3,)),
                    replace(task, rig=Rig(spring=1.0)),
                    replace(task, settings=replace(CHEAP, symmetry=False)),
                    replace(task, solver="another")):
        assert not set(task.ids) & set(changed.ids)
    assert replace(task, fields=True).ids == task.ids
    for more in ({"fields": True}, {"figures": True}, {"ask": Ask(("modes",))}):
        assert replace(task, **more).id != task.id
    same = specimen_toml().replace('"oval"', '"other"').replace("1 mm", "1000 um")
    [equal] = tasks(tmp_path / "b", LOADS, oval=same)
    assert equal.ids == task.ids


@pytest.mark.parametrize("written", [
    '{ from = "10 g", to = "20 g", count = 3 }', '"10 g..20 g in 3"', '"10 g, 15 g, 20 g"',
    '["10 g", "15 g", "0.02 kg"]'])
def test_several_masses_are_written_as_everywhere(tmp_path, written: str) -> None:
    text = LOADS.replace('"17.9 g"', written)
    [task] = tasks(tmp_path, text)
    assert task.masses == pytest.approx((0.01, 0.015, 0.02))


def test_a_range_that_does_not_say_its_count_has_that_of_everywhere(tmp_path) -> None:
    text = LOADS.replace('"17.9 g"', '{ from = "10 g", to = "20 g" }')
    [task] = tasks(tmp_path, text)
    assert task.masses == pytest.approx(np.linspace(0.01, 0.02, RANGE))


REFUSED = {
    "unknown key": (LOADS + '[grid]\n"plate.radiuss" = ["1 cm"]',
                    r"SWEEP.toml: plate.radiuss: unknown key"),
    "wrong unit": (LOADS + '[grid]\n"plate.radius" = ["1 kg"]',
                   r"SWEEP.toml: plate.radius: given '1 kg': wrong dim"),
    "range": (LOADS + '[grid]\n"membrane.thickness" = ["-1 mm"]',
              r"SWEEP.toml: membrane.thickness: given '-1 mm'"),
    "rig": (LOADS + '[grid]\n"rig.sprin" = ["1 N/m"]',
            r"SWEEP.toml: rig.sprin: unknown key: did you mean 'spring'"),
    "top": (LOADS + 'volts = "1 kV"', r"SWEEP.toml: volts: unknown key"),
    "NUL": (LOADS.replace("specimen = \"", "specimen = \"\\u0000"),
            r"SWEEP.toml: specimen: given .*no file has NUL in its name"),
    "lengths": (LOADS
                + '[list]\n"plate.radius" = ["1 cm"]\n"membrane.thickness" = ["1 mm", "2 mm"]',
                r"as long as"),
    "twice": (LOADS + '[grid]\n"plate.radius" = ["1 cm"]\n[list]\n"plate.radius" = ["1 cm"]',
              r"one of \[grid\]"),
    "whole and part": (
        LOADS + '[grid]\n"frame.semi_axes" = [["6 cm", "5 cm"]]\n"frame.semi_axes.0" = ["7 cm"]',
        "whole"),
    "element": (LOADS + '[grid]\n"frame.semi_axes.2" = ["6 cm"]',
                r"frame.semi_axes.2.*elements 0 to 1"),
    "mass twice": (LOADS + '[grid]\nmass = ["1 g"]', r"mass: is also varied"),
    "descending": (LOADS.replace('"1 kV"', '["2 kV", "1 kV"]'), r"voltage: given .*must ascend"),
    "mass unit": (LOADS.replace("17.9 g", "17.9 mm"), r"mass: given '17.9 mm'"),
    "method": (LOADS + '[sample]\nmethod = "sobel"\ncount = 2',
               r"sample.method: given 'sobel': must be one of"),
    "count": (LOADS + '[sample]\nmethod = "sobol"\ncount = 2.5', r"sample.count: given 2.5"),
    "seed": (LOADS + '[sample]\nmethod = "sobol"\ncount = 2\nseed = 4294967296\n[sample.ranges]\n'
                     '"plate.radius" = ["1 cm", "2 cm"]',
             r"sample.seed: given 4294967296: must be a whole number from 0 to 4294967295"),
    "order": (LOADS
              + '[sample]\nmethod = "sobol"\ncount = 2\n[sample.ranges]\n"plate.radius" = ["2 '
                'cm", "1 cm"]',
              r"sample.ranges.plate.radius: given .*smaller first"),
    "kinds": (LOADS
              + '[sample]\nmethod = "sobol"\ncount = 2\n[sample.ranges]\n"plate.radius" = ["2 '
                'cm", "3 kg"]',
              r"sample.ranges.plate.radius: given .*one kind"),
    "undotted": (LOADS + '[grid]\nplate.radius = ["1 cm"]',
                 r"grid.plate: must be a list or a range; write a dotted key"),
    "ask": (LOADS + 'ask = ["alfa"]',
            r"SWEEP.toml: ask: given 'alfa': must be one of alpha, .*; did you mean 'alpha'"),
    "asked twice": (LOADS + 'ask = ["modes", "modes"]', r"SWEEP.toml: ask: "),
    "circles": (LOADS + 'circles = 7', r"SWEEP.toml: circles: given 7: must be from 1 to 6"),
    "radii": (LOADS + 'radii = "best"', r"SWEEP.toml: radii: given 'best': must be one of"),
    "alike": (LOADS + '[grid]\n"plate.radius" = ["1 cm", "1 cm"]',
              r"SWEEP.toml: grid.plate.radius: given .*different"),
    "one file many times": (LOADS.replace('"oval.toml"', "[" + 20_000 * '"oval.toml", ' + "]"),
                            r"SWEEP.toml: specimen: given 'oval': must be specimens of different"),
    "no specimen": ('mass = "1 g"\nvoltage = "1 kV"', r"specimen: is missing"),
    "none possible": (
        LOADS + '[grid]\n"plate.radius" = ["5 cm", "6 cm"]',
        r"none of the specimens can be built.*inside"),
}


@pytest.mark.parametrize("mistake", REFUSED)
def test_mistakes_are_one_message(tmp_path, mistake: str, capsys) -> None:
    text, words = REFUSED[mistake]
    file = written(tmp_path, text)
    with pytest.raises(InputError, match=words):
        read_sweep(file)
    assert main(["sweep", str(file), "-o", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_mistakes_are_said_before_drawing_is_imported(tmp_path) -> None:
    """It takes longer to import than the plan to read."""
    file = written(tmp_path, LOADS + "volts = 1")
    code = ("import sys; from tympan.cli import main; "
            f"main(['sweep', {str(file)!r}, '-o', {str(tmp_path / 'out')!r}]); "
            "print(*sys.modules)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "unknown key" in done.stderr
    assert not {"matplotlib", "pyvista"} & set(done.stdout.split())


def test_a_mistake_in_the_specimen_names_its_file(tmp_path) -> None:
    broken = specimen_toml().replace('"1 mm"', '"1 kg"')
    with pytest.raises(InputError, match=r"oval.toml: membrane.thickness: given '1 kg'"):
        read(tmp_path, LOADS + '[grid]\n"plate.radius" = ["1 cm"]', oval=broken)


def test_files_that_a_specimen_names_are_beside_it(tmp_path: Path) -> None:
    """Not beside the sweep, though that changes the specimen."""
    films = tmp_path / "films"
    films.mkdir()
    frame = Specimen("frame", Circle(45e-3), None, Film(1e-3, (2.0, 2.0), NeoHooke(2e4), 4.7))
    write_dxf([membrane_part(frame)], films / "frame.dxf")
    (films / "drawn.toml").write_text("""name = "drawn"
[frame]
shape = "dxf"
file = "frame.dxf"
curve = "outer"
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = [2.0, 2.0]
material = "vhb-4910"
relative_permittivity = 4.7
""", encoding="utf-8")
    planned = tasks(tmp_path, 'specimen = "films/drawn.toml"\nmass = "17.9 g"\nvoltage = "1 kV"\n'
                              '[grid]\n"membrane.thickness" = ["0.9 mm", "1 mm"]\n')
    assert [task.specimen.membrane.thickness for task in planned] == pytest.approx([0.9e-3, 1e-3])
    assert all(task.specimen.frame.curve.area == pytest.approx(np.pi * 45e-3**2, rel=1e-6)
               for task in planned)
