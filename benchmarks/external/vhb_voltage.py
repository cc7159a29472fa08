"""A strip of VHB 4905 stretched without voltage and under 6 kV: why the stress drops less.

The strips are 0.5 mm thick. Nominal stress is the derivative of the energy by the stretch at a
fixed width, so a film whose width is λ^(-q) drops by ε₀ ε_r (U/T)² λ^(1-2q): q is 0 in pure shear
and ½ in a narrow strip. A narrow strip whose width is free besides drops by half of that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.constants import epsilon_0
from scipy.optimize import least_squares

from benchmarks.external.by_command import command_table, strip_dataset
from benchmarks.external.case import DATA, Case, draw, table, words
from tympan.base.arrays import Array, Mask
from tympan.reports import look
from tympan.studies.data.coupon import Coupons, read_coupons
from tympan.studies.estimation.correlation import CorrelatedSpread

FOLDER = DATA / "vhb4905"
COUPONS = Path(__file__).parents[1] / "vhb" / "vhb-4905.csv"
VOLTAGE, THICKNESS = 6e3, 0.5e-3
#: Numbers of the runs in the file: without voltage and under it, by temperature [°C].
RUNS = {23: (701, 703), 50: (702, 704)}
#: Of one batch from the spectrometer's, relative; the lowest frequency common to all spectra [Hz].
_BATCH, _SLOW = 0.05, 0.27
#: A stretch at which both strips are straight.
_TAUT = 1.05


@dataclass(frozen=True, eq=False)
class Strip:
    """Both runs at one temperature [°C]: stress drop [Pa] and stress without voltage, by stretch.

    ``loading`` marks readings on the way up; ``permittivity`` is that of the spectra.
    """

    temperature: float
    stretch: Array
    drop: Array
    stress: Array
    loading: Mask
    permittivity: float

    def ideal(self, permittivity: float) -> Array:
        """Of a film in pure shear [Pa]."""
        field = VOLTAGE / THICKNESS
        return np.asarray(epsilon_0 * permittivity * field**2 * self.stretch)


def load(temperature: int) -> Strip:
    """The runs of the digitised file, paired at the stretches of that without voltage."""
    plain, charged = (_test(run) for run in RUNS[temperature])
    stretch, stress, drop, loading = [], [], [], []
    for up in (True, False):
        (a, b), (c, d) = (_leg(part, up) for part in (plain, charged))
        inside = (a >= max(_TAUT, c.min()) - 1e-9) & (a <= c.max() + 1e-9)
        stretch.append(a[inside])
        stress.append(b[inside])
        drop.append(b[inside] - np.interp(a[inside], c, d))
        loading.append(np.full(inside.sum(), up))
    return Strip(temperature, np.concatenate(stretch), np.concatenate(drop),
                 np.concatenate(stress), np.concatenate(loading), slow_permittivity(temperature))


def _test(number: int) -> Coupons:
    """A run by its number in the file."""
    tests = read_coupons(FOLDER / "6_coupled.csv")
    return tests[tests.run == f"6_coupled {number}"]


def _leg(run: Coupons, up: bool) -> tuple[Array, Array]:
    """Stretch, ascending, and stress [Pa] on the way up or down."""
    top = int(run.stretch.argmax())
    part = run[: top + 1] if up else run[top:][::-1]
    return part.stretch, part.stress


def write_dataset(folder: Path, temperatures: tuple[int, ...], back: bool) -> None:
    """The digitised runs as a dataset of held strips whose drops are judged."""
    film = (f'thickness = "{THICKNESS * 1e3:g} mm"\nmaterial = "vhb-4905-viscous"\n'
            f"relative_permittivity = {slow_permittivity(23):.4g}")
    lines = ["mode,stretch,nominal_stress_kPa,run,voltage_kV,temperature_C\n"]
    for temperature in temperatures:
        for run, kilovolt in zip(RUNS[temperature], (0.0, VOLTAGE / 1e3), strict=True):
            part = _test(run)
            part = part if back else part[: int(part.stretch.argmax()) + 1]
            state = f"{run},{kilovolt},{temperature}\n"
            lines += [f"pure_shear,{stretch:.6g},{stress / 1e3:.6g},{state}"
                      for stretch, stress in zip(part.stretch, part.stress, strict=True)
                      if stretch >= _TAUT - 1e-9]
    (folder / "dataset.toml").write_text(
        strip_dataset("VHB 4905 under 6 kV", film, 'coupon_reading = "drop"'), encoding="utf-8")
    (folder / "coupon.csv").write_text("".join(lines), encoding="utf-8")


DATASETS = {
    "23 °C, up": partial(write_dataset, temperatures=(23,), back=False),
    "23 °C, up and down": partial(write_dataset, temperatures=(23,), back=True),
    "23 and 50 °C, up": partial(write_dataset, temperatures=(23, 50), back=False),
}


def slow_permittivity(temperature: float) -> float:
    """ε_r of the dielectric spectra at their slow end, between their temperatures."""
    rows = pd.read_csv(FOLDER / "5_dielectric.csv", sep=";", decimal=",", encoding="latin-1")
    points = {}
    for kelvin, part in rows.groupby("temp"):
        order = np.argsort(part.freq.to_numpy())
        points[float(kelvin) - 273.15] = float(np.interp(
            np.log(_SLOW), np.log(part.freq.to_numpy()[order]), part.dielec.to_numpy()[order]))
    places = sorted(points)
    return float(np.interp(temperature, places, [points[place] for place in places]))


#: Drop [Pa] of a strip by its permittivity and a cause's size.
Model = Callable[[Strip, float, float], Array]


@dataclass(frozen=True)
class Cause:
    """Why a strip drops otherwise than in pure shear, of a ``size`` in a ``unit``."""

    name: str
    symbol: str
    unit: str
    drop: Model


def _rate_slope(stretch: Array) -> Array:
    """Growth of the stress with the logarithm of the rate [Pa], from cycles at 0.03 and 0.1 /s."""
    coupons, curves = read_coupons(COUPONS), {}
    for rate in (0.03, 0.1):
        name = next(run for run in dict.fromkeys(coupons.run.tolist())
                    if run.startswith(f"{rate:g}/s") and run.endswith("4.0"))
        run = coupons[coupons.run == name]
        top = int(run.stretch.argmax()) + 1
        curves[rate] = np.interp(stretch, run.stretch[:top], run.stress[:top])
    return np.asarray((curves[0.1] - curves[0.03]) / np.log(0.1 / 0.03))


def _cooling_slope(stretch: Array) -> Array:
    """Fall of the stress by a kelvin [Pa], from the two strips without voltage."""
    curves = []
    for temperature in RUNS:
        strip = load(temperature)
        stretches, stresses = (part[strip.loading] for part in (strip.stretch, strip.stress))
        curves.append(np.interp(stretch, stretches, stresses))
    return np.asarray((curves[0] - curves[1]) / 27.0)


CAUSES = (
    Cause("ideal, in pure shear", "", "", lambda strip, e, _: strip.ideal(e)),
    Cause("width not held", "q", "",
          lambda strip, e, q: strip.ideal(e) * strip.stretch ** (-2 * q)),
    Cause("permittivity falls with stretch", "n", "",
          lambda strip, e, n: strip.ideal(e) * (1 - n / 2) * strip.stretch**-n),
    Cause("less voltage on the film", "k", "",
          lambda strip, e, k: strip.ideal(e) * (1 + k) ** 2),
    Cause("stiffer strip under voltage", "m", "",
          lambda strip, e, m: strip.ideal(e) - m * strip.stress),
    Cause("faster run under voltage", "ln r", "",
          lambda strip, e, r: strip.ideal(e) - r * _rate_slope(strip.stretch)),
    Cause("cooler strip under voltage", "ΔT", "K",
          lambda strip, e, t: strip.ideal(e) - t * _cooling_slope(strip.stretch)),
)


@dataclass(frozen=True, eq=False)
class Fit:
    """A cause fitted to the loading of a strip.

    ``size`` with its 95 % limits, which allow for correlated errors, and ε_r; ``misfit`` is χ² with
    the prior of ε_r, ``rms`` of the drop [Pa].
    """

    cause: Cause
    size: float
    limits: tuple[float, float]
    permittivity: float
    misfit: float
    rms: float

    def missed(self, strip: Strip, loading: bool = True) -> float:
        """Rms [Pa] on readings of a strip, ε_r changed as the spectra do."""
        chosen = strip.loading == loading
        permittivity = self.permittivity * strip.permittivity / slow_permittivity(23)
        model = self.cause.drop(strip, permittivity, self.size)
        return _rms((model - strip.drop)[chosen])


def scatter(strip: Strip) -> float:
    """Standard deviation of a drop from its second differences on the way up [Pa]."""
    bent = np.diff(strip.drop[strip.loading], 2)
    return _rms(bent) / np.sqrt(6)


def fit(cause: Cause, strip: Strip) -> Fit:
    """The cause's size and ε_r, that within its batch of the spectra's."""
    sigma, spread = scatter(strip), _BATCH * strip.permittivity
    up = strip.loading

    def residual(values: Array) -> Array:
        drop = cause.drop(strip, values[0], values[1])[up]
        prior = (values[0] - strip.permittivity) / spread
        return np.append((drop - strip.drop[up]) / sigma, prior)

    best = least_squares(residual, [strip.permittivity, 0.0], x_scale=[1.0, 0.1],
                         xtol=1e-14, ftol=1e-14, gtol=1e-14)
    rows = sigma * best.jac[:-1]
    free = [0, 1] if cause.symbol else [0]
    noise = CorrelatedSpread.of(rows[:, free], sigma * best.fun[:-1], [np.arange(up.sum())])
    weight = np.linalg.inv(noise.covariance)
    weight[0, 0] += spread**-2
    half = 1.96 * float(np.sqrt(np.linalg.inv(weight)[-1, -1])) if cause.symbol else 0.0
    size = float(best.x[1])
    return Fit(cause, size, (size - half, size + half), float(best.x[0]),
               float(best.fun @ best.fun), _rms(sigma * best.fun[:-1]))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def section(folder: Path) -> str:
    """Data, misfit of an ideal film, causes and what each misses elsewhere, a picture."""
    cold, warm = load(23), load(50)
    fits = sorted((fit(cause, cold) for cause in CAUSES), key=lambda result: result.misfit)
    best, ideal = fits[0], next(result for result in fits if not result.cause.symbol)
    falling = next(result for result in fits if result.cause.symbol == "n")
    rows = [[result.cause.name, _size(result), f"{result.permittivity:.2f}",
             f"{result.misfit:.0f}", f"{result.rms / 1e3:.2f}", f"{result.missed(warm) / 1e3:.2f}",
             f"{result.missed(cold, False) / 1e3:.2f}"] for result in fits]
    plain = ideal.cause.drop(cold, cold.permittivity, 0.0)
    return words("vhb_voltage").format(
        readings=_readings(cold, warm), command=command_table(DATASETS)[0],
        epsilon=cold.permittivity, warm_epsilon=warm.permittivity,
        scatter=scatter(cold) / 1e3, before=_rms((plain - cold.drop)[cold.loading]) / 1e3,
        causes=table(["cause", "size, 95 % limits", "ε_r", "χ²", "23 °C, up [kPa]",
                      "50 °C, up [kPa]", "23 °C, down [kPa]"], rows),
        name=best.cause.name.capitalize(), warm_scatter=scatter(warm) / 1e3,
        symbol=best.cause.symbol, size=best.size, low=best.limits[0],
        high=best.limits[1], rms=best.rms / 1e3, warm=best.missed(warm) / 1e3,
        before_warm=ideal.missed(warm) / 1e3,
        gain=ideal.missed(warm) / best.missed(warm), n=falling.size, n_epsilon=falling.permittivity,
        n_off=(falling.permittivity / cold.permittivity - 1) / _BATCH,
        down=best.missed(cold, False) / 1e3,
        picture=draw(folder, "vhb-voltage", lambda: compose(cold, warm, fits)))


def _size(result: Fit) -> str:
    if not result.cause.symbol:
        return ""
    low, high = result.limits
    unit = f" {result.cause.unit}" if result.cause.unit else ""
    return f"{result.cause.symbol} = {result.size:.2f}{unit} ({low:.2f} to {high:.2f})"


def _readings(cold: Strip, warm: Strip) -> str:
    stretches = (1.05, 1.5, 2.0, 2.5, 2.9)
    rows = [["ideal, pure shear, ε_r of the spectra",
             *(f"{value / 1e3:.1f}" for value in np.interp(
                 stretches, cold.stretch[cold.loading],
                 cold.ideal(cold.permittivity)[cold.loading]))]]
    for strip, way in ((cold, True), (warm, True), (cold, False), (warm, False)):
        part = strip.loading == way
        drops = np.interp(stretches, strip.stretch[part], strip.drop[part])
        rows.append([f"{strip.temperature} °C, {'up' if way else 'down'}",
                     *(f"{drop / 1e3:.1f}" for drop in drops)])
    return table(["drop [kPa] at stretch", *(f"{stretch:g}" for stretch in stretches)], rows)


def compose(cold: Strip, warm: Strip, fits: list[Fit]) -> Figure:
    """Drops on the way up, the ideal film, and the three causes that miss them least."""
    figure = look.new_figure(66.0, 130.0)
    axes = look.place_axes(figure, 14, 5, 108, 50)
    for number, strip in enumerate((cold, warm)):
        up = strip.loading
        axes.plot(strip.stretch[up], strip.drop[up] / 1e3, look.marker_of(number), markersize=3,
                  color=look.colour_of(number), label=f"measured, {strip.temperature} °C")
    up = cold.loading
    axes.plot(cold.stretch[up], cold.ideal(cold.permittivity)[up] / 1e3, "--", color="0.4",
              label="ideal, pure shear")
    for number, result in enumerate(fits[:3], start=2):
        drop = result.cause.drop(cold, result.permittivity, result.size)
        axes.plot(cold.stretch[up], drop[up] / 1e3, color=look.colour_of(number),
                  label=f"{result.cause.name}, ε_r {result.permittivity:.2f}")
    look.describe(axes, "stretch", "drop of the stress under 6 kV [kPa]")
    axes.set_ylim(0, 28)
    axes.legend(loc="upper left")
    return figure


CASE = Case("vhb_voltage", section)
