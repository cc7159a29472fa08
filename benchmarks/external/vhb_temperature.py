"""VHB 4905 stretched at six temperatures and three rates: what changes, the modulus or time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import least_squares

from benchmarks.external.by_command import command_table, strip_dataset
from benchmarks.external.case import DATA, Case, draw, table, words
from tympan.base.arrays import Array
from tympan.reports import look
from tympan.studies.data.coupon import Coupons, read_coupons

FOLDER = DATA / "vhb4905"
#: The run without which nothing is said: its temperature [°C] and rate [1/s].
USUAL, RATE = 20, 0.05
#: Temperatures [°C] that are fitted; the others are held out.
FITTED = (20, 40, 60)
#: Stretches at which runs on the way up are compared.
STRETCHES = np.linspace(1.2, 3.9, 10)
_ICE, _GAS = 273.15, 8.314
#: A stretch at which all strips are straight.
_TAUT = 1.02


@dataclass(frozen=True, eq=False)
class Run:
    """Nominal stress [Pa] at :data:`STRETCHES` on the way up, at a temperature [°C], rate [1/s]."""

    temperature: int
    rate: float
    stress: Array


def runs() -> list[Run]:
    """Those to a stretch of 4, three rates at each of six temperatures."""
    return [Run(_celsius(part), _rate(part), _upwards(part)) for part in _far().values()]


@cache
def at_rest() -> tuple[float, ...]:
    """The quasi-static test at 20 °C [Pa]."""
    tests = read_coupons(FOLDER / "2_quasi-static.csv")
    return tuple(_upwards(tests[tests.run == "2_quasi-static 201"]).tolist())


def _far() -> dict[str, Coupons]:
    """Runs to a stretch of 4, by their number."""
    tests = read_coupons(FOLDER / "4_loading.csv")
    runs = {name.split()[-1]: tests[rows] for name, rows in tests.series.items()}
    return {number: part for number, part in runs.items() if 3.9 < part.stretch.max() < 5}


def _celsius(part: Coupons) -> int:
    return round(float(part.degrees[0]))


def _rate(part: Coupons) -> float:
    """Of the stretch [1/s]: its way over the time, which was made from the rate."""
    return round(float(np.abs(np.diff(part.stretch)).sum() / part.time[-1]), 6)


def _rise(part: Coupons) -> Coupons:
    return part[: int(part.stretch.argmax()) + 1]


def _upwards(part: Coupons) -> Array:
    rise = _rise(part)
    return np.interp(STRETCHES, rise.stretch, rise.stress)


def write_dataset(folder: Path, temperatures: tuple[int, ...], rates: tuple[float, ...]) -> None:
    """Runs on the way up as a dataset of uniaxial strips of the library's film, in time."""
    lines = ["mode,stretch,nominal_stress_kPa,run,t_s,temperature_C\n"]
    for number, part in _far().items():
        celsius, rise = _celsius(part), _rise(part)
        if celsius not in temperatures or _rate(part) not in rates:
            continue
        lines += [f"uniaxial,{stretch:.6g},{stress / 1e3:.6g},{number},{when:.5g},{celsius}\n"
                  for stretch, stress, when in zip(rise.stretch, rise.stress, rise.time,
                                                   strict=True) if stretch >= _TAUT]
    film = 'thickness = "0.5 mm"\nrelative_permittivity = 4.7\nmaterial = "vhb-4905-viscous"'
    (folder / "dataset.toml").write_text(
        strip_dataset("VHB 4905 warm and cold", film), encoding="utf-8")
    (folder / "coupon.csv").write_text("".join(lines), encoding="utf-8")


DATASETS = {
    "20, 40, 60, 80 °C, 0.05 /s": partial(write_dataset, temperatures=(20, 40, 60, 80),
                                           rates=(RATE,)),
    "20, 40, 60 °C, three rates": partial(write_dataset, temperatures=FITTED,
                                           rates=(0.03, RATE, 0.1)),
}


#: Stress [Pa] of a run by what is usual, and the constants.
Model = Callable[[Run, Array, Array], Array]


@dataclass(frozen=True)
class Cause:
    """What temperature and rate do, with its ``constants`` and where their search begins."""

    name: str
    constants: tuple[str, ...]
    start: tuple[float, ...]
    stress: Model


def _shifted(run: Run, usual: Array, values: Array) -> Array:
    """What relaxes is as at 20 °C at the rate a_T times as high, by Arrhenius; the rest grows as T.

    ``values``: the exponent of the rate and the activation energy [kJ/mol].
    """
    exponent, energy = values
    kelvin, base = run.temperature + _ICE, USUAL + _ICE
    shift = np.exp(1e3 * energy / _GAS * (1 / kelvin - 1 / base))
    rest = np.array(at_rest())
    return np.asarray(rest * kelvin / base
                      + (usual - rest) * (run.rate * shift / RATE) ** exponent)


CAUSES = (
    Cause("nothing: as at 20 °C and 0.05 /s", (), (), lambda run, usual, _: usual),
    Cause("rubber: modulus with absolute temperature", (), (),
          lambda run, usual, _: usual * (run.temperature + _ICE) / (USUAL + _ICE)),
    Cause("modulus falls by a share a kelvin", ("share [%/K]",), (0.5,),
          lambda run, usual, v: usual * np.exp(-0.01 * v[0] * (run.temperature - USUAL))),
    Cause("stress grows with a power of the rate", ("power",), (0.1,),
          lambda run, usual, v: usual * (run.rate / RATE) ** v[0]),
    Cause("modulus and rate", ("share [%/K]", "power"), (0.5, 0.1),
          lambda run, usual, v: (usual * np.exp(-0.01 * v[0] * (run.temperature - USUAL))
                                 * (run.rate / RATE) ** v[1])),
    Cause("time runs with temperature", ("power", "energy [kJ/mol]"), (0.2, 60.0), _shifted),
)


@dataclass(frozen=True, eq=False)
class Fit:
    """A cause fitted to :data:`FITTED`: constants with 95 % limits, misfit by temperature.

    Misfits are root mean squares of the logarithm of the stress, in all of a temperature's runs.
    Limits count each run as one reading: its stretches are not independent.
    """

    cause: Cause
    values: Array
    halves: Array
    misfit: dict[int, float]

    def over(self, temperatures: tuple[int, ...]) -> float:
        """Misfit over several temperatures."""
        return float(np.sqrt(np.mean([self.misfit[part] ** 2 for part in temperatures])))


def fit(cause: Cause, tests: list[Run]) -> Fit:
    """Least squares of the logarithm of the stress."""
    usual = next(run.stress for run in tests if (run.temperature, run.rate) == (USUAL, RATE))
    chosen = [run for run in tests if run.temperature in FITTED]

    def missed(values: Array, part: list[Run]) -> Array:
        return np.concatenate([np.log(cause.stress(run, usual, values) / run.stress)
                               for run in part])

    values, halves = np.zeros(0), np.zeros(0)
    if cause.constants:
        best = least_squares(missed, cause.start, args=(chosen,), x_scale=np.abs(cause.start))
        values = best.x
        freedom = len(chosen) - len(values)
        variance = np.sum(best.fun**2) / len(STRETCHES) / freedom
        curvature = best.jac.T @ best.jac / len(STRETCHES)
        halves = 1.96 * np.sqrt(variance * np.diag(np.linalg.inv(curvature)))
    by_temperature = {
        temperature: float(np.sqrt(np.mean(missed(values, [
            run for run in tests if run.temperature == temperature]) ** 2)))
        for temperature in sorted({run.temperature for run in tests})}
    return Fit(cause, values, halves, by_temperature)


def section(folder: Path) -> str:
    """Causes, misfit by temperature, verdict, a picture."""
    tests = runs()
    fits = [fit(cause, tests) for cause in CAUSES]
    held_out = tuple(part for part in fits[0].misfit if part not in FITTED)
    warm = tuple(part for part in held_out if part > USUAL)
    best = min(fits, key=lambda result: result.over(FITTED))
    shifted = fits[-1]
    rows = [[result.cause.name, _constants(result),
             *(f"{100 * result.misfit[part]:.0f}{'' if part in FITTED else ' *'}"
               for part in result.misfit)] for result in fits]
    return words("vhb_temperature").format(
        runs=len(tests), command=command_table(DATASETS)[0], causes=table(
            ["cause", "constants, 95 %", *(f"{part} °C" for part in fits[0].misfit)], rows),
        before=fits[0].over(FITTED), best=best.cause.name, after=best.over(FITTED),
        warm=best.over(warm), warm_before=fits[0].over(warm),
        gain=fits[0].over(warm) / best.over(warm), cold=best.misfit[-20],
        cold_before=fits[0].misfit[-20], shifted=shifted.over(FITTED),
        share=fits[-2].values[0] / 100, shifted_warm=shifted.over(warm),
        shifted_cold=shifted.misfit[-20], frost=best.misfit[0], shifted_frost=shifted.misfit[0],
        picture=draw(folder, "vhb-temperature", lambda: compose(tests, fits)))


def _constants(result: Fit) -> str:
    return "; ".join(f"{name} {value:.3g} ± {half:.2g}" for name, value, half in zip(
        result.cause.constants, result.values, result.halves, strict=True))


def compose(tests: list[Run], fits: list[Fit]) -> Figure:
    """Stress at a stretch of 2.1 against temperature, by rate, with the two fullest causes."""
    figure = look.new_figure(76.0, 120.0)
    axes = look.place_axes(figure, 14, 5, 98, 48)
    usual = next(run.stress for run in tests if (run.temperature, run.rate) == (USUAL, RATE))
    place = int(np.argmin(np.abs(STRETCHES - 2.1)))
    line = range(-20, 81, 5)
    for number, rate in enumerate((0.03, 0.05, 0.1)):
        mine = sorted((run for run in tests if run.rate == rate), key=lambda run: run.temperature)
        axes.plot([run.temperature for run in mine], [run.stress[place] / 1e3 for run in mine],
                  look.marker_of(number), color=look.colour_of(number), markersize=4,
                  label=f"measured, {rate:g} /s")
        for result, style in zip(fits[-2:], ("--", "-"), strict=True):
            stress = [result.cause.stress(Run(part, rate, usual), usual, result.values)[place] / 1e3
                      for part in line]
            axes.plot(line, stress, style, color=look.colour_of(number), linewidth=0.9)
    for result, style in zip(fits[-2:], ("--", "-"), strict=True):  # of all three rates
        axes.plot([], [], style, color="black", linewidth=0.9, label=result.cause.name)
    axes.set_yscale("log")
    look.describe(axes, "temperature [°C]", f"stress at a stretch of {STRETCHES[place]:.1f} [kPa]")
    figure.legend(loc="lower center", ncols=2)
    return figure


CASE = Case("vhb_temperature", section)
