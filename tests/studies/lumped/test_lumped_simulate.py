"""The lumped model in time: another integrator, the linearised model, energy, signals, and the
command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from tests.oracles.lumped_model import equations
from tests.support.checks.json_schema import printed_record
from tests.support.lumped import MODELS, free_energy
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.paper.table1 import paper_actuators
from tympan.studies.data.dataset import read_dataset
from tympan.studies.lumped.actuator import Actuator, Viscous
from tympan.studies.lumped.equilibria import pull_in, roots
from tympan.studies.lumped.linear import linearise
from tympan.studies.lumped.simulate import ModelResponse, sample, simulate
from tympan.studies.signals import Pieces, Sine, ramp, random_steps, read_signal, step
from tympan.studies.trace import settling_time

PAPER = MODELS["paper"]
ACTUATORS = Path(__file__).parents[3] / "studies" / "shipped"


@pytest.mark.parametrize("signal", [step(0.0, 3.5e3, 0.0, 1.0), step(1e3, 3.5e3, 0.3, 1.0),
                                    ramp(0.0, 5e3, 1.0),
                                    Sine(2e3, 2e3, 0.5, 2.0), random_steps(0.0, 6e3, 0.25, 4, 7)],
                         ids=["step", "late step", "ramp", "sine", "random"])
def test_against_an_explicit_integrator_of_the_printed_equations(signal: Pieces | Sine) -> None:
    """DOP853 at 1e-12, on the equations typed again, with the signal written again as a lookup."""
    response = simulate(PAPER, signal)
    state = response.state(np.array([0.0]))[0]
    worst = 0.0
    for piece, (begin, end) in enumerate(zip(signal.breaks[:-1], signal.breaks[1:], strict=True)):
        other = solve_ivp(lambda t, x, piece=piece: equations(x, signal.within(piece, t),
                                                              (0.4, 0.6), 17.9e-3, 8.5),
                          (begin, end), state, "DOP853", rtol=1e-12, atol=1e-15, dense_output=True)
        time = np.linspace(begin, end, 200)[:-1]
        worst = max(worst, float(np.abs(response.deflection(time) - other.sol(time)[0]).max()))
        state = other.y[:, -1]
    assert worst < 2e-9


def test_small_steps_follow_the_linear_model() -> None:
    """The difference from exp(A t) falls with the square of the step."""
    linear = linearise(PAPER, 3e3)
    time = np.linspace(0, 1.0, 101)
    errors = []
    for height in (8.0, 4.0, 2.0):
        moved = simulate(PAPER,
                         step(3e3, 3e3 + height, 0.0, 1.0)).deflection(time) - linear.deflection
        forced = np.linalg.solve(linear.a, linear.b[:, 0]) * height
        expected = np.array([(linear.c @ (expm(linear.a * t) @ forced - forced))[0] for t in time])
        errors.append(float(np.abs(moved - expected).max() / np.abs(expected).max()))
    assert errors[0] < 0.01
    assert np.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.2)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("name", MODELS)
def test_energy_never_grows_at_a_constant_voltage(name: str) -> None:
    """From seeded states away from rest; and without any viscosity it stays."""
    actuator = MODELS[name]
    rng = np.random.default_rng(3)
    constant = step(2e3, 2e3, 0.5, 1.0)
    for _ in range(2):
        start = np.concatenate([[rng.uniform(1e-3, 6e-3), rng.uniform(-0.1, 0.1)],
                                rng.uniform(0, 0.01, actuator.count)])
        states = simulate(actuator, constant, start).state(np.linspace(0, 1, 2001))
        energy = free_energy(actuator, states, 2e3)
        swing = float(np.ptp(energy))
        assert swing > 1e-6
        assert np.diff(energy).max() < 1e-6 * swing
    free = Actuator(actuator.circles, actuator.weights, actuator.mass, Viscous(0.0, 1.0, 0.0),
                    actuator.rig)
    energy = free_energy(free, simulate(free, constant, start).state(np.linspace(0, 1, 501)), 2e3)
    assert float(np.ptp(energy)) < 1e-4 * swing


def test_hysteresis_goes_as_the_signal_slows_and_has_the_sign_of_loss() -> None:
    widths = []
    for period in (20.0, 4000.0):
        u, y = simulate(PAPER, Sine(3.5e3, 3.5e3, period, 2.0)).last_loop(
            period).to_numpy().T
        area = -np.sum((y[1:] + y[:-1]) / 2 * np.diff(u))
        widths.append(area / (np.ptp(u) * np.ptp(y)))
    assert widths[0] > 5 * widths[1] > 0


def test_a_loop_closes_once_the_film_has_crept_far_enough() -> None:
    """From period to period the drift falls as the slow eigenvalue says, between those at 3.5 and
    at 5 kV."""
    simulated = [sample(simulate(PAPER, Sine(3.5e3, 3.5e3, 4.0, count)), 0.01, 4.0)
                 for count in (2.0, 3.0, 12.0)]
    ends = [run.loop["deflection"].iloc[[0, -1]].to_numpy() for run in simulated]
    drifts = [last - first for first, last in ends]
    slow = [np.linalg.eigvals(linearise(PAPER, volts).a).real.max() for volts in (3.5e3, 5e3)]
    assert np.exp(4.0 * slow[0]) < drifts[1] / drifts[0] < np.exp(4.0 * slow[1])
    creeping = [any("more periods" in words for words in run.warnings)
                for run in simulated]
    assert creeping == [True, True, False]


def test_a_step_overshoots_into_pull_in_where_a_slow_ramp_would_still_hold() -> None:
    """Without viscosity the motion passes the unstable rest at 0.995 of the pull-in voltage, and
    does not at half."""
    actuator = Actuator.of(paper_actuators(8.5)[0], 17.9e-3, viscous=Viscous(0.0, 1.0, 0.0))
    limit, turning = pull_in(actuator) or (np.nan, np.nan)
    for share, passes in ((0.995, True), (0.5, False)):
        barrier = roots(actuator, share * limit)[0][1] if passes else turning
        moved = simulate(actuator,
                         step(0.0, share * limit, 0.0, 0.5)).deflection(np.linspace(0, 0.5, 501))
        assert (moved.max() > barrier) == passes


def test_a_film_thrown_beyond_the_models_reach_is_followed_until_there() -> None:
    """Against DOP853 with an event: when it leaves, and where it is half way."""
    start = PAPER.rest(0.98 * PAPER.reach, 0.0)
    start[1] = 200.0
    constant = step(2e3, 2e3, 0.5, 1.0)

    def gone(_: float, state: np.ndarray) -> float:
        return PAPER.reach - float(state[0])

    gone.terminal = True  # type: ignore[attr-defined]
    other = solve_ivp(lambda _, x: PAPER.linear(x, 2e3)[0], (0, 1), start, "DOP853", rtol=1e-11,
                      atol=1e-13, events=gone, dense_output=True)
    response = simulate(PAPER, constant, start)
    assert other.status == 1
    assert response.stopped is not None
    assert response.stopped.time == pytest.approx(other.t[-1], rel=1e-7)
    half = np.array([response.end / 2])
    assert response.deflection(half) == pytest.approx(other.sol(half)[0], rel=1e-7)
    assert "drawn in after" in sample(response, 1e-4).warnings[0]


def test_settling_time_ignores_slow_creep() -> None:
    t = np.linspace(0, 20, 40001)
    fast = 1e-4 * np.exp(-1.4 * t) * np.cos(70 * t)
    assert settling_time(t, fast - 1e-4 * np.exp(-t / 7)) == pytest.approx(np.log(20) / 1.4,
                                                                           abs=0.1)
    assert np.isnan(settling_time(t, t))
    early = t < 1.5
    assert np.isnan(settling_time(t[early], fast[early]))


def test_random_steps_repeat_by_seed() -> None:
    first, same, other = (random_steps(0.0, 7e3, 30.0, 20, seed) for seed in (1, 1, 2))
    assert np.array_equal(first.voltage, same.voltage)
    assert not np.array_equal(first.voltage, other.voltage)
    assert np.diff(first.breaks) == pytest.approx(np.full(20, 30.0))


def test_signal_from_csv_is_the_same_signal(tmp_path: Path) -> None:
    time = np.linspace(0, 2, 2001)
    voltage = np.interp(time, [0, 0.5, 1.5, 2], [0, 2, 2, 1])
    file = tmp_path / "u.csv"
    file.write_text("t_s,voltage_kV\n"
                    + "".join(f"{t:.6f},{u:.9f}\n" for t, u in zip(time, voltage, strict=True)))
    read = read_signal(file)
    assert len(read.breaks) == 4
    other = simulate(PAPER, Pieces(np.array([0, 0.5, 1.5, 2]), 1e3 * np.array([0.0, 2, 2, 1])))
    assert simulate(PAPER, read).deflection(time) == pytest.approx(other.deflection(time),
                                                                   abs=1e-10)


@pytest.mark.parametrize(("text", "words"), [
    ("", "empty"), ("t_s,voltage_kV\n", "no readings"),
    ("t_s,voltage_kV\n0,1\n2,1\n1,1\n", "after the line before"),
    ("t_s,voltage_kV\n0,1\n1,nan\n", "finite"), ("t_s,voltage_kV\n0,1\n", "two rows"),
    ("t_s,voltage_kV\n0,0\n1,500\n", "reach, 105 mm, is at"), ("t_s,volt\n0,0\n", "unknown column"),
])
def test_bad_signals_are_one_message(text: str, words: str, tmp_path: Path,
                                     capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "u.csv"
    file.write_text(text)
    assert main(["lumped", "simulate", str(ACTUATORS / "circular.toml"), "--paper", "--signal",
                 str(file)]) == 2
    message = capsys.readouterr().err
    assert words in message
    assert message.count("\n") == 1


def test_signals_made_in_python_are_checked() -> None:
    for time, voltage in (([0, 1], [0, np.nan]), ([1, 0], [0, 1]), ([0], [0]), ([0, 1], [0, 1e9])):
        with pytest.raises(InputError):
            Pieces(np.array(time, float), np.array(voltage, float))


def test_simulate_command_writes_what_a_dataset_reads(tmp_path: Path,
                                                      capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    names = [str(ACTUATORS / f"{name}.toml") for name in ("circular", "elliptical-large")]
    assert main(["lumped", "simulate", *names, "--signal", "step", "--duration", "0.5 s",
                 "--interval", "5 ms", "--paper",
                 "--alpha", "0.6,0.4", "-o", str(out), "--json"]) == 0
    printed = printed_record(capsys.readouterr().out)
    assert [response["alpha"] for response in printed["responses"]] == [[1.0], [0.6, 0.4]]
    assert printed == json.loads((out / "simulate.json").read_text())
    assert (out / "response.png").stat().st_size > 10_000
    assert ModelResponse.load(out).json() == printed
    drawn = (out / "response.svg").read_bytes()
    assert main(["report", str(out)]) == 0
    assert (out / "response.svg").read_bytes() == drawn
    head = 'name = "made"\n' + "".join(
        "[[specimen]]\n" + "\n".join(line.replace("[", "[specimen.") if line.startswith("[")
                                     else line
                                     for line in Path(name).read_text().splitlines()) + "\n"
                                     for name in names)
    (out / "dataset.toml").write_text(head)
    data = read_dataset(out)
    assert data.transients is not None
    # A step comes at once: in front stands the rest that it begins from.
    assert len(data.transients) == 2 * 102
    assert data.transients.voltage[:3].tolist() == [0.0, 3.5e3, 3.5e3]
    assert data.transients.t[0] < 0 == data.transients.t[1]
    assert data.transients.displacement[0] == pytest.approx(printed["responses"][0]["first_m"],
                                                            rel=1e-9)


@pytest.mark.parametrize(("options", "words"), [
    (["--signal", "saw"], "must be step, ramp"), (["--alpha", "a,b"], "comma between"),
    (["--alpha", "0.9"], "2 numbers"),
    (["--duration", "-1 s"], "positive"), (["--table-1", "0"], "at least 1"),
    (["--high", "900 kV"], "reach"),
    (["--table-1", "9", "--mass", "5 g", "--high", "12 kV"], "pull-in is at"),
])
def test_bad_options_are_one_message(options: list[str], words: str,
                                     capsys: pytest.CaptureFixture[str]) -> None:
    large = str(ACTUATORS / "elliptical-large.toml")
    assert main(["lumped", "simulate", large, "--paper", *options]) == 2
    message = capsys.readouterr().err
    assert words in message
    assert message.count("\n") == 1


@pytest.mark.parametrize("signal", [step(0.0, 3e3, 0.0, 1.0), Sine(1.5e3, 1.5e3, 2.0, 2.0)],
                         ids=["step", "sine"])
def test_extremes_are_those_between_samples(signal: Sine | Pieces) -> None:
    motion = simulate(PAPER, signal)
    often = motion.deflection(np.linspace(0.0, motion.end, 400_001))
    assert motion.extremes == pytest.approx((often.min(), often.max()), rel=0, abs=1e-12)
