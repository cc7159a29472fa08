"""A film in closed form that a test alone registers answers every question by its formula."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest
from scipy.constants import epsilon_0
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import norm

import tympan
from tests.oracles.cone import Cone
from tests.support.specimens import ROUND, circular, specimen_toml
from tests.support.tolerances import STILL
from tympan.cli import main
from tympan.fem.film.laws import Ogden
from tympan.fem.membrane.formula import FORMULAS, Formula
from tympan.fem.rig import Rig


# The stranger, of less than thirty lines.
def stretches(specimen, deflection):
    """Meridians of a truncated cone are stretched evenly."""
    gap = specimen.frame.radius - specimen.plate.outline.radius
    first, second = specimen.membrane.prestretch
    return first * (1 + (deflection / gap) ** 2) ** 0.5, second


def energy(specimen, deflection, squared):
    """What its law and its charge store."""
    film, (along, around) = specimen.membrane, stretches(specimen, deflection)
    elastic, thin = film.material.derivatives(along, around)[0], 1 / (along * around)
    charged = epsilon_0 * film.relative_permittivity * squared / (film.thickness * thin) ** 2 / 2
    flat = pi * (specimen.frame.radius**2 - specimen.plate.outline.radius**2)
    return flat * film.volume_per_area * (elastic - charged)


def volume(specimen, deflection):
    """What a truncated cone holds."""
    large, small = specimen.frame.radius, specimen.plate.outline.radius
    return pi * deflection * (large**2 + large * small + small**2) / 3


BARE, WHOLE = Formula("bare cone", energy), Formula("cone", energy, volume, stretches)
# Here the stranger ends.

MU, ALPHA, PRESTRETCH, THICKNESS = 40e3, 1.3, 2.0, 1e-3
FILM = circular(Ogden((MU,), (ALPHA,)), prestretch=(PRESTRETCH, PRESTRETCH))
CONE = Cone(MU, ALPHA, PRESTRETCH, THICKNESS)
MASS = 0.02
FILM_TOML = specimen_toml("cone", ROUND, """[membrane.material]
law = "ogden"
mu = ["40 kPa"]
alpha = [1.3]
""", PRESTRETCH)
WEIGHT = MASS * Rig().gravity
#: Voltage at which the film is asked; its pull-in is at 10.8 kV.
VOLTAGE = 6e3


@pytest.fixture(autouse=True, scope="module")
def stranger() -> Iterator[None]:
    for formula in (BARE, WHOLE):
        FORMULAS.register(formula)
    yield
    for formula in (BARE, WHOLE):
        del FORMULAS[formula.name]


@pytest.fixture
def settings() -> tympan.Settings:
    return tympan.Settings(formula="cone")


@pytest.fixture
def bare() -> tympan.Settings:
    return tympan.Settings(formula="bare cone")


def near(value: float, relative: float = 1e-7) -> object:
    """The value to the accuracy of Newton's method."""
    return pytest.approx(value, rel=relative)


def test_its_equilibrium_is_that_of_its_formula(settings) -> None:
    found = tympan.solve(FILM, settings=settings, mass=MASS, voltage=VOLTAGE)
    place = CONE.deflection(WEIGHT, VOLTAGE)
    assert found.deflection_m == near(place)
    assert found.stroke_m == near(place - CONE.deflection(WEIGHT))
    assert found.reaction_N == near(WEIGHT)
    assert found.capacitance_F == near(CONE.capacitance(place))
    assert found.energy_J == near(CONE.stored(place) - CONE.capacitance(place) * VOLTAGE**2 / 2)
    assert found.max_stretch == near(CONE.stretch(place))
    assert found.max_true_stress_Pa == near(CONE.true_stress(place, VOLTAGE)[0])
    assert found.max_field_V_per_m == near(CONE.field(place, VOLTAGE))
    assert found.dofs == 1


def test_without_stretches_it_has_no_fields_and_says_so(bare, tmp_path) -> None:
    found = tympan.solve(FILM, settings=bare, mass=MASS, voltage=VOLTAGE)
    assert found.deflection_m == near(CONE.deflection(WEIGHT, VOLTAGE))
    for key in ("max_stretch", "max_true_stress_Pa", "max_field_V_per_m", "breakdown_margin",
                "slack_area_m2"):
        assert getattr(found, key) is None
    assert any("no surface" in words for words in found.warnings)
    assert found.film is None


def test_gas_below_it_lifts_it(settings) -> None:
    found = tympan.solve(FILM, settings=settings, mass=MASS, voltage=VOLTAGE, pressure=20.0)
    assert found.deflection_m == near(CONE.deflection(WEIGHT, VOLTAGE, 20.0))


def test_a_film_without_a_volume_bears_no_gas(bare) -> None:
    with pytest.raises(tympan.InputError, match="volume below"):
        tympan.solve(FILM, settings=bare, mass=MASS, pressure=20.0)


def test_its_limits_are_those_of_its_formula(settings, bare) -> None:
    _, voltage = CONE.pull_in(WEIGHT)
    alone = tympan.limits(FILM, settings=bare, mass=MASS)
    assert alone.limits.first == "pull_in"
    assert [limit.kind for limit in alone.limits.reached] == ["pull_in"]
    assert alone.limits.pull_in.voltage_V == near(voltage)
    strong = replace(FILM, membrane=replace(FILM.membrane, strength=tympan.ConstantStrength(30e6)))
    whole = tympan.limits(strong, settings=settings, mass=MASS).limits
    assert whole.pull_in.voltage_V == near(voltage)

    def tension(place: float) -> float:
        return min(CONE.true_stress(place, CONE.voltage(place, WEIGHT)))

    def strength(place: float) -> float:
        return 30e6 - CONE.field(place, CONE.voltage(place, WEIGHT))

    start = CONE.deflection(WEIGHT) * (1 + 1e-9)
    for limit, margin in ((whole.tension, tension), (whole.breakdown, strength)):
        place = brentq(margin, start, CONE.pull_in(WEIGHT)[0], xtol=1e-13)
        assert limit.voltage_V == near(CONE.voltage(place, WEIGHT), 1e-6)
    assert whole.first == min((whole.tension, whole.breakdown, whole.pull_in),
                              key=lambda limit: limit.voltage_V).kind


@pytest.mark.parametrize("along", ["voltage", "charge", "mass"])
def test_its_path_follows_its_formula(bare, along: str) -> None:
    found = tympan.path(FILM, along=along, mass=MASS, voltage=0.0, settings=bare)
    assert len(found.stations) > 10
    for station in found.stations:
        place = station.deflection_m
        assert station.force_N == near(CONE.force(place, station.voltage_V), 1e-6)
        assert station.capacitance_F == near(CONE.capacitance(place))
        assert station.max_stretch is None
        assert station.stable == (CONE.stiffness(place, station.voltage_V) > 0)
    if along == "voltage":
        (event,) = found.events
        assert event.what == "pull_in"
        assert event.value == near(CONE.pull_in(WEIGHT)[1])


def test_its_curve_is_that_of_its_formula(settings) -> None:
    found = tympan.curve(FILM, mass=MASS, voltage=[0.0, 3e3, VOLTAGE], settings=settings)
    assert found.curves[0].limits.pull_in.voltage_V == near(CONE.pull_in(WEIGHT)[1])
    rows = found.to_pandas().query("asked == 1")
    assert rows["voltage"].tolist() == [0.0, 3e3, VOLTAGE]
    for voltage, place in zip(rows["voltage"], rows["deflection"], strict=True):
        assert place == near(CONE.deflection(WEIGHT, voltage))


def test_its_force_is_that_of_its_formula(bare) -> None:
    found = tympan.force(FILM, to="12 mm", voltage=[0.0, VOLTAGE], mass=[MASS], points=9,
                         settings=bare)
    for curve, voltage in zip(found.curves, (0.0, VOLTAGE), strict=True):
        for number, place in enumerate(curve.displacement_m):
            assert curve.force_N[number] == pytest.approx(CONE.force(place, voltage), abs=1e-12)
            assert curve.stiffness_N_per_m[number] == near(CONE.stiffness(place, voltage), 1e-6)
            assert curve.capacitance_F[number] == near(CONE.capacitance(place))
    rest, charged = CONE.deflection(WEIGHT), CONE.deflection(WEIGHT, VOLTAGE)
    assert found.stroke_m == near(charged - rest)
    assert found.work_J == near(WEIGHT * (charged - rest))
    assert found.blocked_force_N == near(WEIGHT - CONE.force(rest, VOLTAGE))


def test_a_magnet_snaps_it_as_its_formula_says(bare) -> None:
    magnet = tympan.Magnet(force=1.2, gap=9e-3, decay=4e-3)

    def squared(place: float) -> float:
        """U² of equilibrium."""
        pull = magnet.force * (1 + (magnet.gap - place) / magnet.decay) ** -magnet.power
        return (CONE.pull(place) - pull - WEIGHT) / CONE.by_squared(place)

    places = np.linspace(1e-3, 8.9e-3, 500)
    there = np.array([squared(place) for place in places])
    first = int(np.argmax(there > 0))
    top = first + int(np.argmax(np.diff(there[first:]) < 0))
    most = minimize_scalar(lambda place: -squared(place), bounds=places[[top - 1, top + 1]],
                           method="bounded", options={"xatol": 1e-12})
    assert 0 < -most.fun < CONE.pull_in(WEIGHT)[1] ** 2
    found = tympan.limits(FILM, settings=bare, mass=MASS, rig=Rig(biases=(magnet,))).limits
    met = found.snap_through or found.pull_in
    assert met.voltage_V == near((-most.fun) ** 0.5, 1e-6)


def test_both_doors_take_it(tmp_path, capsys) -> None:
    file = tmp_path / "film.toml"
    file.write_text(FILM_TOML, encoding="utf-8")
    options = [str(file), "--mass", "20 g", "--voltage", "6 kV", "--json"]
    assert main(["solve", *options, "--formula", "cone"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["deflection_m"] == near(CONE.deflection(WEIGHT, VOLTAGE))
    assert main(["solve", *options, "--formula", "sphere"]) == 2
    assert "--formula: given 'sphere'" in capsys.readouterr().err


def test_its_swings_are_those_of_its_stiffness(bare) -> None:
    found = tympan.modes(FILM, count=3, settings=bare, mass=MASS, voltage=VOLTAGE)
    place = CONE.deflection(WEIGHT, VOLTAGE)
    (mode,) = found.modes
    assert mode.name == "heave"
    assert mode.frequency_Hz == near((CONE.stiffness(place, VOLTAGE) / MASS) ** 0.5 / (2 * pi))
    assert found.film_mass_kg is None


def test_its_response_is_that_of_an_oscillator(bare) -> None:
    damper = 0.1
    rig = Rig(plate_damping=damper)
    found = tympan.response(FILM, frequency=[0.01, 5.0, 20.0], settings=bare, mass=MASS,
                            voltage=VOLTAGE, rig=rig)
    place = CONE.deflection(WEIGHT, VOLTAGE)
    stiffness, drive = CONE.stiffness(place, VOLTAGE), 2 * VOLTAGE * CONE.by_squared(place)
    for number, frequency in enumerate((0.01, 5.0, 20.0)):
        w = 2 * pi * frequency
        exact = drive / (stiffness - w**2 * MASS + 1j * w * damper)
        assert found.amplitude_m_per_V[number] == near(abs(exact), 1e-6)
        assert found.phase_deg[number] == pytest.approx(np.degrees(np.angle(exact)), abs=1e-4)
    damping = damper / (2 * (stiffness * MASS) ** 0.5)
    assert found.damping == near(damping, 1e-6)
    damped = (stiffness / MASS * (1 - damping**2)) ** 0.5
    assert found.natural_Hz == near(damped / (2 * pi), 1e-6)


def test_its_motion_is_that_of_its_plate(bare) -> None:
    damper = 0.2
    found = tympan.transient(FILM, signal="step", mass=MASS, swing=True, high=VOLTAGE,
                             duration="0.5 s", interval="5 ms", rig=Rig(plate_damping=damper),
                             settings=bare)
    samples = found.to_pandas()
    there = samples["t_s"].to_numpy() >= 0
    times = samples["t_s"].to_numpy()[there]
    exact = CONE.motion(MASS, damper, WEIGHT, VOLTAGE, times)
    moved = np.ptp(exact)
    assert samples["displacement_m"].to_numpy()[there] == pytest.approx(exact, abs=2e-3 * moved)
    (response,) = found.responses
    balance = response.energy
    rest, end = CONE.deflection(WEIGHT), exact[-1]
    assert balance.load_work_J == near(WEIGHT * (end - rest), 1e-2)
    assert balance.unexplained_J == pytest.approx(0.0, abs=1e-3 * balance.electrical_work_J)


def test_its_lumped_model_is_built_from_its_formula(bare) -> None:
    found = tympan.lumped.build(FILM, mass=[MASS], voltage=(0.0, VOLTAGE), count=4,
                                settings=bare)
    (built,) = found.numbers["built"] if isinstance(found.numbers, dict) else found.json()["built"]
    for row in found.to_pandas().itertuples():
        place = CONE.deflection(WEIGHT, row.voltage_V)
        assert row.field_mm == near(1e3 * place)
        assert row.field_pF == near(1e12 * CONE.capacitance(place))
    for voltage, frequency in zip((0.0, VOLTAGE), built["frequency_Hz"]["field"], strict=True):
        place = CONE.deflection(WEIGHT, voltage)
        assert frequency == near((CONE.stiffness(place, voltage) / MASS) ** 0.5 / (2 * pi))


def test_its_sweep_has_a_row_of_its_formula_for_each_film(settings, tmp_path) -> None:
    (tmp_path / "film.toml").write_text(FILM_TOML, encoding="utf-8")
    (tmp_path / "sweep.toml").write_text("""specimen = "film.toml"
mass = "20 g"
voltage = ["0 kV", "6 kV"]
ask = ["limits", "modes"]
[grid]
"membrane.thickness" = ["0.9 mm", "1 mm"]
"frame.radius" = ["44 mm", "45 mm"]
""", encoding="utf-8")
    rows = tympan.sweep(tmp_path / "sweep.toml", settings=settings).to_pandas()
    assert len(rows) == 8
    for row in rows.to_dict("records"):
        cone = replace(CONE, thickness=row["membrane.thickness_m"], frame=row["frame.radius_m"])
        place = cone.deflection(WEIGHT, row["voltage_V"])
        assert row["by"] == "cone"
        assert row["deflection_m"] == near(place)
        assert row["capacitance_F"] == near(cone.capacitance(place))
        assert row["max_stretch"] == near(cone.stretch(place))
        assert row["pull_in_V"] == near(cone.pull_in(WEIGHT)[1])
        stiffness = cone.stiffness(place, row["voltage_V"])
        assert row["heave_Hz"] == near((stiffness / MASS) ** 0.5 / (2 * pi))


def test_its_tolerances_move_it_as_its_formula_says(bare) -> None:
    """One number scatters, so quantiles of results are results of quantiles."""
    share = 0.05
    tolerances = replace(STILL, thickness=tympan.Scatter(film=share))
    found = tympan.tolerance(FILM, tolerances=tolerances, mass=MASS, voltage=VOLTAGE, films=4096,
                             settings=bare).quantities

    def cone(quantile: float) -> Cone:
        return replace(CONE, thickness=THICKNESS * np.exp(share * norm.ppf(quantile)))

    def deflection(of: Cone) -> float:
        return of.deflection(WEIGHT, VOLTAGE)

    def frequency(of: Cone) -> float:
        return (of.stiffness(deflection(of), VOLTAGE) / MASS) ** 0.5 / (2 * pi)

    def limit(of: Cone) -> float:
        return of.pull_in(WEIGHT)[1]

    def blocked(of: Cone) -> float:
        return WEIGHT - of.force(of.deflection(WEIGHT), VOLTAGE)

    for key, value in (("deflection_m", deflection), ("frequency_Hz", frequency),
                       ("limit_V", limit), ("blocked_force_N", blocked)):
        low, middle, high = sorted(value(cone(each)) for each in (0.05, 0.5, 0.95))
        spread = found[key]
        assert spread.nominal == near(value(CONE), 1e-3 if key == "limit_V" else 1e-7)
        assert spread.median == near(middle, 1e-3)
        # 4096 films have the quantiles of a normal distribution to some hundredths of its width.
        assert spread.low == pytest.approx(low, abs=0.03 * (high - low))
        assert spread.high == pytest.approx(high, abs=0.03 * (high - low))


def test_many_of_it_have_states_without_error(settings) -> None:
    family = tympan.FilmFamily.around(
        FILM, {"membrane.thickness": (0.9e-3, 1.1e-3), "frame.radius": (43e-3, 47e-3),
               "stiffness": (0.9, 1.1)}, force=(0.1, 0.3), voltage=(0.0, 9e3), settings=settings)
    rows = family.drawn(50)
    states = family.states(rows, WEIGHT, VOLTAGE)
    ends = family.ends(rows, WEIGHT)
    for number, (thickness, frame, factor) in enumerate(rows):
        cone = replace(CONE, thickness=thickness, frame=frame, mu=factor * MU)
        place = cone.deflection(WEIGHT, VOLTAGE)
        assert states.deflection[number, 0] == near(place)
        assert states.capacitance[number, 0] == near(cone.capacitance(place))
        assert states.stress[number, 0] == near(cone.true_stress(place, VOLTAGE)[0], 1e-6)
        assert states.stiffness[number, 0] == near(cone.stiffness(place, VOLTAGE), 1e-3)
        assert states.error[number, 0] == 0

        def slack(place: float, cone: Cone = cone) -> float:
            return min(cone.true_stress(place, cone.voltage(place, WEIGHT)))

        gone = brentq(slack, cone.deflection(WEIGHT) * (1 + 1e-9), cone.pull_in(WEIGHT)[0])
        if np.isfinite(ends.tension[number, 0]):
            assert ends.tension[number, 0] == near(cone.voltage(gone, WEIGHT), 1e-3)
        else:
            assert cone.voltage(gone, WEIGHT) > 9e3


def test_a_design_is_where_its_formula_meets_the_bound(bare, tmp_path) -> None:
    (tmp_path / "film.toml").write_text(FILM_TOML, encoding="utf-8")
    (tmp_path / "wanted.toml").write_text("""specimen = "film.toml"
mass = "20 g"
voltage = "6 kV"
tolerances = "none"
[want]
stroke = "largest"
frequency = "12 Hz"
[vary]
"membrane.thickness" = ["0.8 mm", "1.5 mm"]
""", encoding="utf-8")
    best = tympan.design(tmp_path / "wanted.toml", settings=bare).films[0]

    def frequency(thickness: float) -> float:
        cone = replace(CONE, thickness=thickness)
        slow = min((0.0, VOLTAGE), key=lambda voltage: cone.stiffness(
            cone.deflection(WEIGHT, voltage), voltage))
        return (cone.stiffness(cone.deflection(WEIGHT, slow), slow) / MASS) ** 0.5 / (2 * pi)

    thickness = brentq(lambda thickness: frequency(thickness) - 12, 0.8e-3, 1.5e-3)
    assert best.numbers["membrane.thickness"].value == near(thickness, 1e-3)
    cone = replace(CONE, thickness=best.numbers["membrane.thickness"].value)
    assert best.aim == near(cone.deflection(WEIGHT, VOLTAGE) - cone.deflection(WEIGHT), 1e-6)


def written_readings(folder: Path, hidden: float) -> Path:
    """Readings of the formula with a sensor whose zero is off by a ``hidden`` length [m]."""
    (folder / "film.toml").write_text(FILM_TOML, encoding="utf-8")
    (folder / "dataset.toml").write_text("""name = "cone"
noise = "10 um"
[[specimen]]
file = "film.toml"
[rig]
""", encoding="utf-8")
    noise = np.random.default_rng(1)
    rows = ["specimen,mass_g,voltage_kV,displacement_mm"]
    for mass in (15, 30, 45):
        for voltage in range(8):
            place = CONE.deflection(1e-3 * mass * Rig().gravity, 1e3 * voltage) + hidden
            rows.append(f"cone,{mass},{voltage},{1e3 * place + noise.normal(0, 0.01):.5f}")
    (folder / "static.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    return folder


@pytest.mark.parametrize("library", [("sensor_zero", "voltage_sag", "friction", "drift",
                                      "strain_stiffening")], indirect=True)
@pytest.mark.parametrize("hidden", [0.0, 0.1e-3])
def test_a_diagnosis_by_it_finds_what_is_hidden(library, hidden: float, tmp_path) -> None:
    found = tympan.diagnose(written_readings(tmp_path, hidden), formula="bare cone")
    told = found.json()
    if not hidden:
        assert told["verdict"] == "nothing"
        assert told["misfit"]["baseline_rmse_um"] < 12
        return
    assert told["verdict"] == "named"
    assert told["causes"][0]["effect"] == "sensor_zero"
    (size,) = told["causes"][0]["parameters"].values()
    assert size["low"] < 1e6 * hidden < size["high"]


def test_its_stiffness_is_fitted_to_readings(tmp_path, bare) -> None:
    found = tympan.fit_material(written_readings(tmp_path, 0.0), settings=bare)
    for factor in (found.stiffness_factor, found.permittivity_factor):
        assert factor.low < 1 < factor.high
        assert factor.high - factor.low < 0.1


def test_its_derivatives_are_those_of_its_formula(settings) -> None:
    found = tympan.sensitivity(FILM, of=["heave", "capacitance", "energy"], settings=settings,
                               mass=MASS, voltage=VOLTAGE).quantities

    def quantities(cone: Cone, mass: float = MASS, voltage: float = VOLTAGE) -> np.ndarray:
        place = cone.deflection(mass * Rig().gravity, voltage)
        stored = cone.stored(place) - cone.capacitance(place) * voltage**2 / 2
        return np.array([place, cone.capacitance(place), stored])

    def slope(name: str) -> np.ndarray:
        own = {"mass": MASS, "voltage": VOLTAGE}.get(name) or getattr(CONE, name)
        ends = []
        for step in (-1e-4 * own, 1e-4 * own):
            changed = {name: own + step}
            ends.append(quantities(CONE, **changed) if name in ("mass", "voltage")
                        else quantities(replace(CONE, **changed)))
        return (ends[1] - ends[0]) / (2e-4 * own)

    keys = {"membrane.material.mu.0": "mu", "membrane.material.alpha.0": "alpha",
            "membrane.thickness": "thickness", "membrane.relative_permittivity": "permittivity",
            "frame.radius": "frame", "plate.outline.radius": "plate", "mass": "mass",
            "voltage": "voltage"}
    for key, name in keys.items():
        exact = slope(name)
        for number, quantity in enumerate(("heave", "capacitance", "energy")):
            assert found[quantity].by[key].derivative == near(exact[number], 1e-5), (key, quantity)
    with pytest.raises(tympan.InputError, match="no fields"):
        tympan.sensitivity(FILM, of="max_stretch", settings=settings, mass=MASS, voltage=VOLTAGE)


def test_its_capacitance_tells_its_deflection(bare) -> None:
    found = tympan.sense(FILM, voltage=[0.0, VOLTAGE], mass=[MASS], settings=bare)
    for state in found.states:
        place = CONE.deflection(WEIGHT, state.voltage_V)
        assert state.displacement_m == near(place)
        assert state.capacitance_F == near(CONE.capacitance(place))
        assert state.sensed_m == pytest.approx(place, abs=2e-6)


def test_two_of_it_are_joined_by_a_rod(bare) -> None:
    """A double cone: another film pulls the plate back, as a function of its own deflection."""
    distance, rod = 10e-3, 13e-3
    rig = Rig(biases=(tympan.JoinedFilm(FILM, distance=distance, rod=rod),))
    found = tympan.solve(FILM, settings=bare, mass=MASS, voltage=VOLTAGE, rig=rig)

    def missing(place: float) -> float:
        other = place + rod - distance
        return CONE.force(place, VOLTAGE) + CONE.force(abs(other)) * np.sign(other) - WEIGHT

    assert found.deflection_m == pytest.approx(brentq(missing, -5e-3, 10e-3), abs=1e-9)


def test_what_needs_a_mesh_says_in_a_sentence_that_it_has_none(bare, tmp_path) -> None:
    with pytest.raises(tympan.InputError, match="no mesh to write"):
        tympan.export(FILM, tmp_path, settings=bare)
    assert any("no surface" in words
               for words in tympan.modes(FILM, settings=bare, mass=MASS).warnings)
    viscous = replace(FILM, membrane=replace(FILM.membrane, branches=(
        tympan.ViscousBranch(10e3, 1.0),)))
    with pytest.raises(tympan.InputError, match="no memory"):
        tympan.solve(viscous, settings=bare, mass=MASS)
    with pytest.raises(tympan.InputError, match="cannot tilt"):
        tympan.solve(FILM, settings=bare, mass=MASS, rig=Rig(weight_offset=(1e-3, 0.0)))


def test_what_it_wrote_is_read_again(bare, tmp_path) -> None:
    found = tympan.path(FILM, mass=MASS, settings=bare)
    found.save(tmp_path)
    assert tympan.report(tmp_path)
    assert type(found.numbers).load(tmp_path).stations == found.stations
