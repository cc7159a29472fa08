"""Three loading modes of one rubber: laws fitted to one or two of them, and what the third says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.external.by_command import command_table, strip_dataset
from benchmarks.external.case import DATA, Case, draw, table, words
from tympan.base.arrays import Array
from tympan.reports import look
from tympan.studies.columns import write_sheet
from tympan.studies.data.coupon import COLUMNS, MODES, Coupons, read_coupons
from tympan.studies.estimation.least_squares import minima, seeded_starts
from tympan.studies.material.families import FAMILIES, LawFamily, largest_excess
from tympan.studies.material.fit import compare, coupon_problem, judged, material_lines

#: Source of each set, by the name of its files.
SETS = {"treloar_1944": "Treloar 1944, vulcanised rubber",
        "kawabata_1981": "Kawabata 1981, vulcanised rubber",
        "meunier_2008": "Meunier 2008, unfilled silicone"}
MEGA = 1e6

#: Laws of the first invariant alone.
FIRST_INVARIANT = ("neo_hooke", "yeoh", "gent", "arruda_boyce")

#: Searches for each shape constant; below this share of the mode's stress an error is small; minima
#: whose errors differ by less than this share are equally good.
_STARTS, _SMALL, _ALIKE = 12, 0.05, 0.01


def load(name: str) -> Coupons:
    """The coupons of one source: nominal stress [Pa] against stretch, in three modes."""
    return read_coupons(*(DATA / "rubber" / f"{name}_{mode}.txt" for mode in MODES))


@dataclass(frozen=True, eq=False)
class Foretold:
    """A law fitted to some modes, on each mode: its error over the mode's own stress (rms).

    ``bias`` is the mean error in the lower and in the upper half of each mode's stretches, in the
    same unit; ``admissible`` says whether a film could be made of the law.
    """

    law: str
    fitted: tuple[str, ...]
    error: dict[str, float]
    bias: dict[str, tuple[float, float]]
    admissible: bool
    values: Array

    @property
    def held_out(self) -> tuple[str, ...]:
        """Modes that it was not fitted to."""
        return tuple(mode for mode in MODES if mode not in self.fitted)

    @property
    def worst(self) -> float:
        """Of the held-out modes."""
        return max(self.error[mode] for mode in self.held_out)


def constants(family: LawFamily, coupons: Coupons) -> Array:
    """Of the best minimum, an admissible one where there is any.

    Of several that are equally good the smallest constants: they cancel each other least.
    """
    least, most = family.starts(largest_excess(*coupons.in_plane))
    shaped, linear = len(family.shape), len(family.linear)
    shapes = seeded_starts(least, most, shaped, _STARTS * max(1, shaped))
    starts = np.concatenate([np.zeros((len(shapes), linear)), shapes], axis=1)
    unit = 1e-8 * float(np.sqrt(np.mean(coupons.stress**2)))
    ends = [family.ordered(end) for end in minima(coupon_problem(family, coupons, unit), starts)]
    errors = [_error(family, end, coupons) for end in ends]
    able = [number for number, end in enumerate(ends) if _may_be(family, end, coupons)]
    least_error = errors[(able or [0])[0]]
    alike = [ends[number] for number in able or range(len(ends))
             if errors[number] <= (1 + _ALIKE) * least_error]
    return min(alike, key=lambda end: float(np.abs(end[:linear]).sum()))


def _error(family: LawFamily, values: Array, coupons: Coupons) -> float:
    """Root mean square of the stresses missed [Pa]."""
    missed = family.stress(*coupons.in_plane, values) - coupons.stress
    return float(np.sqrt(np.mean(missed**2)))


def _may_be(family: LawFamily, values: Array, coupons: Coupons) -> bool:
    _, material, failing = judged(family, values, coupons)
    return material is not None and failing is None


def foretold(law: str, coupons: Coupons, fitted: tuple[str, ...]) -> Foretold:
    """A law fitted to the readings of some modes, judged on all."""
    family = FAMILIES[law]
    values = constants(family, coupons[np.isin(coupons.mode, fitted)])
    error, bias = {}, {}
    for mode in MODES:
        part = coupons[coupons.mode == mode]
        with np.errstate(all="ignore"):
            missed = family.stress(*part.in_plane, values) - part.stress
        scale = float(np.sqrt(np.mean(part.stress**2)))
        far = np.abs(part.stretch - 1)
        upper = far > np.median(far)
        error[mode] = _finite(float(np.sqrt(np.mean(missed**2))) / scale)
        bias[mode] = (float(missed[~upper].mean()) / scale, float(missed[upper].mean()) / scale)
    return Foretold(law, fitted, error, bias, _may_be(family, values, coupons), values)


def _finite(value: float) -> float:
    return value if np.isfinite(value) else np.inf


def every(coupons: Coupons) -> list[Foretold]:
    """Every law fitted to each mode alone and to each pair."""
    choices = [*combinations(MODES, 1), *combinations(MODES, 2)]
    return [foretold(law, coupons, fitted) for law in FAMILIES for fitted in choices]


def wrong(result: Foretold, mode: str) -> str:
    """What a mode says is wrong with a law, in words."""
    if not np.isfinite(result.error[mode]):
        return "cannot reach it"
    sides = [(where, bias) for where, bias in zip(("small", "large"), result.bias[mode],
                                                  strict=True) if abs(bias) > _SMALL / 2]
    if result.error[mode] < _SMALL or not sides:
        return "nothing by more than a twentieth"
    return ", ".join(f"too {'stiff' if bias > 0 else 'soft'} at {where} stretches"
                     for where, bias in sides)


def section(folder: Path) -> str:
    """The table of held-out errors of each set, what the best law's third mode says, a picture."""
    blocks, results = [], {}
    for name, title in SETS.items():
        coupons = load(name)
        results[name] = every(coupons)
        blocks += [f"### {title}", held_out_table(results[name]), verdicts(results[name])]
    picture = draw(folder, "rubber", lambda: compose(results))
    invariant = [result.error["equibiaxial"] for part in results.values() for result in part
                 if result.law in FIRST_INVARIANT and result.fitted == ("uniaxial", "pure_shear")]
    return words("rubber").format(sets="\n\n".join(blocks), picture=picture, command=misfits(),
                                  summary=summary(results), low=min(invariant),
                                  high=max(invariant))


def write_dataset(folder: Path, name: str, law: str) -> None:
    """All three modes as a dataset of the law fitted to the uniaxial one."""
    coupons = load(name)
    fit, = compare(coupons[coupons.mode == "uniaxial"], [law])
    if fit.material is None:
        raise ValueError(f"{law} cannot be fitted to {name}")
    lines = material_lines(fit.material, coupons.stretch_range)
    film = ('thickness = "1 mm"\nrelative_permittivity = 3\n'
            + lines.replace("[membrane.", "[specimen.membrane."))
    (folder / "dataset.toml").write_text(strip_dataset(name, film), encoding="utf-8")
    write_sheet(folder / "coupon.csv", COLUMNS[:3], coupons.columns)


DATASETS = {f"{title.split(',')[0]}, {law}": partial(write_dataset, name=name, law=law)
            for name, title in SETS.items() for law in ("neo_hooke", "yeoh")}


def misfits() -> str:
    """What the command says of each law fitted to one mode, where it is wrong, what helps most."""
    rows, said = command_table(DATASETS)
    where = "\n".join(f"* {name}: {content['misfit']['where']}." for name, content in said.items())
    head = ["readings", "effects that explain most", "left [kPa]",
            "each held out, before → after [kPa]"]
    most = table(head, [[name, effects_with_sizes(content), f"{content['after']['rmse_kPa']:.1f}",
                         "; ".join(_split(split) for split in content["gain"]["splits"])]
                        for name, content in said.items()])
    return f"{rows}\n\n{where}\n\n{most}"


def effects_with_sizes(said: Mapping[str, Any]) -> str:
    """The effects of the best hypothesis of a verdict, with their sizes."""
    together = set(said["after"]["effects"])
    return ", ".join(f"`{cause['effect']}` {value['value']:.3f}" for cause in said["causes"]
                     if {cause["effect"], *cause["with"]} == together
                     for value in cause["parameters"].values())


def _split(split: Mapping[str, Any]) -> str:
    misfit = split["rmse_kPa"]
    return f"{split['held_out']} {misfit['before']:.0f} → {misfit['after']:.0f}"


def held_out_table(results: list[Foretold]) -> str:
    """Rows are laws, columns what they were fitted to: error [%] on the held-out modes."""
    choices = list(dict.fromkeys(result.fitted for result in results))
    short = {"uniaxial": "U", "equibiaxial": "E", "pure_shear": "P"}
    head = ["law", *("+".join(short[mode] for mode in fitted) + " → "
                     + ", ".join(short[mode] for mode in MODES if mode not in fitted)
                     for fitted in choices)]
    rows = []
    for law in FAMILIES:
        cells = {result.fitted: result for result in results if result.law == law}
        rows.append([law, *(", ".join(_percent(cells[fitted].error[mode])
                                      for mode in cells[fitted].held_out)
                            + ("" if cells[fitted].admissible else " *") for fitted in choices)])
    return table(head, rows)


def _percent(error: float) -> str:
    return f"{100 * error:.0f}" if error < 10 else "> 1000"


def verdicts(results: list[Foretold]) -> str:
    """Of each pair, the law that its own two modes choose, and what the third says of it."""
    lines = []
    for fitted in combinations(MODES, 2):
        chosen = chosen_by_its_own(results, fitted)
        mode, = chosen.held_out
        lines.append(f"* {_words(fitted)}: {chosen.law} misses them least "
                     f"({_own(chosen):.1%}). {_words((mode,)).capitalize()} then says: "
                     f"{wrong(chosen, mode)} ({_percent(chosen.error[mode])} %).")
    return "\n".join(lines)


def _words(modes: tuple[str, ...]) -> str:
    return " and ".join(mode.replace("_", " ") for mode in modes)


def _own(result: Foretold) -> float:
    return float(np.sqrt(np.mean([result.error[mode] ** 2 for mode in result.fitted])))


def chosen_by_its_own(results: list[Foretold], fitted: tuple[str, ...]) -> Foretold:
    """Of admissible laws that which misses the modes it was fitted to least."""
    able = [result for result in results if result.fitted == fitted and result.admissible]
    return min(able, key=_own)


def summary(results: dict[str, list[Foretold]]) -> str:
    """Median over sets and choices of the held-out errors, by law, after one mode and two."""
    rows = []
    for law in FAMILIES:
        mine = [result for part in results.values() for result in part if result.law == law]
        medians = (np.median([result.worst for result in mine if len(result.fitted) == count])
                   for count in (1, 2))
        refused = sum(not result.admissible for result in mine)
        rows.append([law, *(f"{_percent(float(median))} %" for median in medians),
                     f"{refused} of {len(mine)}"])
    return table(["law", "after one mode", "after two", "inadmissible"], rows)


def compose(results: dict[str, list[Foretold]]) -> Figure:
    """Each set's three modes, and the law that uniaxial and pure shear choose."""
    figure = look.new_figure(62.0)
    for number, (name, part) in enumerate(results.items()):
        axes = look.place_axes(figure, 14 + 57 * number, 8, 42, 42)
        coupons, chosen = load(name), chosen_by_its_own(part, ("uniaxial", "pure_shear"))
        for colour, mode in enumerate(MODES):
            tests = coupons[coupons.mode == mode]
            line = np.linspace(tests.stretch.min(), tests.stretch.max(), 200)
            with np.errstate(all="ignore"):
                stress = FAMILIES[chosen.law].stress(line, line ** MODES[mode], chosen.values)
            axes.plot(tests.stretch, tests.stress / MEGA, look.marker_of(colour), markersize=2.5,
                      color=look.colour_of(colour), label=mode.replace("_", " "))
            axes.plot(line, stress / MEGA, color=look.colour_of(colour),
                      linestyle="--" if mode in chosen.held_out else "-")
        look.describe(axes, "stretch", "nominal stress [MPa]" if not number else "",
                      f"{SETS[name].split(',')[0]}: {chosen.law}")
        top = 1.15 * coupons.stress.max() / MEGA
        axes.set_ylim(1.1 * min(0.0, coupons.stress.min() / MEGA), top)
        if not number:
            axes.legend(loc="upper left")
    return figure


CASE = Case("rubber", section)
