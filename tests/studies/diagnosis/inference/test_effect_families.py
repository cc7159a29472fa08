"""What is named is no finer than what readings tell: families of causes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.specimens import circular
from tests.support.trials import design
from tympan.fem.equilibrium.voltage_path import voltage_path
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Polygon, RoundedRectangle
from tympan.geometry.sectors import covered_share
from tympan.geometry.specimen import Electrode, Patch, Region, Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.diagnosis.gain import gain_of
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.families import family_size, undecided
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.shown.curves import curves
from tympan.studies.effects import EFFECTS, Setup
from tympan.studies.effects.effect import Quantity
from tympan.studies.effects.findings import family_finding

MARGIN = Cause("electrode_margin")
SIGMA = 10e-6
#: Not the mesh of the force laws that are fitted.
MESH = Settings(MeshSettings(order=2, around_plate=12, growth=0.7, across=0.8))


def without_quadrant(specimen: Specimen) -> Specimen:
    """A film whose electrode is an L about the quadrant of positive x and y."""
    a, b = (1.1 * axis for axis in specimen.frame.semi_axes)
    corners = ((0.0, 0.0), (0.0, b), (-a, b), (-a, -b), (a, -b), (a, 0.0))
    return replace(specimen, electrode=Electrode(outline=Region(Polygon(corners))))


def test_the_share_that_is_covered() -> None:
    ring = np.pi * (45e-3**2 - 10e-3**2)
    assert covered_share(circular()) == 1.0
    band = replace(circular(), electrode=Electrode(margin_frame=3e-3, margin_plate=2e-3))
    assert covered_share(band) == pytest.approx(np.pi * (42e-3**2 - 12e-3**2) / ring, rel=1e-12)
    spotted = replace(circular(), electrode=Electrode(patches=(Patch((27e-3, 0.0), 15e-3),)))
    # The integral of 2^(-s^4), s = 2 r/d, over the plane is (pi/ln 2)^(1/2) pi d^2/8.
    spot = (np.pi / np.log(2)) ** 0.5 * np.pi * 15e-3**2 / 8
    assert covered_share(spotted) == pytest.approx(1 - spot / ring, abs=2e-3)
    assert covered_share(without_quadrant(circular())) == pytest.approx(0.75, abs=3e-3)
    half = Region(RoundedRectangle((25e-3, 50e-3), 0.0), (25e-3, 0.0))
    both = replace(circular(), electrode=Electrode(margin_frame=3e-3, outline=half))
    assert covered_share(both) == pytest.approx(
        np.pi / 2 * (42e-3**2 - 10e-3**2) / ring, abs=3e-3)


def test_a_line_over_the_film_decides_and_plates_alone_do_not() -> None:
    assert undecided(MARGIN, {Quantity.ELAPSED}) is MARGIN.effect.family
    assert undecided(MARGIN, {Quantity.ELAPSED, Quantity.SHAPE}) is None
    assert undecided(Cause("sensor_zero"), set()) is None


def test_families_have_members_that_change_what_they_measure() -> None:
    families = {effect.family for effect in EFFECTS.values() if effect.family}
    assert families
    for family in families:
        assert len(family.members) > 1
        assert family.alike[0] <= 1 <= family.alike[1]
        setup = Setup((circular(),), Rig())
        for member in family.members:
            usual = [item.deviation if not item.spread else 0.0 for item in member.parameters]
            changed = member.at(setup, usual, "circle" if member.on_one else None)
            assert family.of(changed.specimens[0]) > family.of(setup.specimens[0]) + 1e-3


@pytest.fixture(scope="module")
def quadrants(three_shapes: Simulation) -> ReadingTable:
    """Readings of electrodes that lack a quarter of the film, by elements on another mesh."""
    table = design(SIGMA, voltages=9)
    setup, values = three_shapes.setup.with_specimens(without_quadrant), np.empty(len(table))
    for ramp in range(int(table.ramp.max()) + 1):
        rows = np.flatnonzero(table.ramp == ramp)
        if not len(rows):
            continue
        model = build_model(setup.specimens[table.specimen[rows[0]]], MESH, setup.rig.loading)
        force = setup.rig.force(float(table.mass[rows[0]]))
        values[rows] = [outcome.state.plate.deflection for outcome in voltage_path(
            model, force, table.voltage[rows].tolist())]
    return table.with_values(values + SIGMA * np.random.default_rng(7).standard_normal(len(table)))


def test_a_missing_quadrant_is_named_by_what_it_has_in_common_with_a_margin(
        three_shapes: Simulation, quadrants: ReadingTable) -> None:
    judged = judge(three_shapes, quadrants, [
        MARGIN, Cause("parallel_spring"), Cause("sensor_zero"), Cause("unaccounted_mass")])
    chosen = judged.chosen
    assert chosen is not None
    assert chosen.hypothesis == (MARGIN,)
    family = undecided(MARGIN, set())
    assert family is not None
    size = family_size(judged.simulation, chosen, MARGIN, family)
    assert size.low < 0.25 < size.high
    assert size.high - size.low < 0.25
    assert family_finding(family, size) == (
        f"The electrodes cover less of the film than stated: {size.range} less")


def test_what_nothing_explains_is_not_extended_and_its_bands_count_the_misfit(
        three_shapes: Simulation, quadrants: ReadingTable) -> None:
    """The same without any effect that leaves film bare."""
    causes = [Cause("parallel_spring"), Cause("sensor_zero"), Cause("unaccounted_mass")]
    judged = judge(three_shapes, quadrants, causes)
    assert judged.verdict == "unexplained"
    report = gain_of(judged.simulation, quadrants, causes, judged)
    gain, predictive = report.overall, report.predictive
    assert report.extends == (gain is not None and gain.rmse_after < gain.rmse_before)
    assert predictive is not None
    assert 0.9 <= predictive.coverage_95 <= 1.0
    narrow = gain_of(judged.simulation, quadrants, causes, replace(judged, verdict="ambiguous"))
    assert narrow.predictive is None or narrow.predictive.coverage_95 < predictive.coverage_95
    films = [np.abs(split.nominally - 0.5) < 0.475 for split in report.splits
             if split.kind == "shape"]
    assert np.mean(np.concatenate(films)) > 0.9
    band, thin = (curves(three_shapes, case, None) for case in (
        judged, replace(judged, verdict="nothing", posterior=None)))
    assert np.nanmin((band["high"] - band["low"]) / (thin["high"] - thin["low"])) > 1
