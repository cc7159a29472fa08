"""Makes the folders: readings by the axisymmetric equations and by closed forms.

None of the project's solvers is used, but for films that are not round, whose lines are of finer
elements of another order (:mod:`benchmarks.trials.verdict_cases.evidence_cases`).

python -m benchmarks.trials.verdict_cases.made
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.trials import axisymmetric_readings
from benchmarks.trials.coupons import readings as coupon_readings
from benchmarks.trials.synthetic_trials import (
    NOBODY,
    NOISE,
    Design,
    Stranger,
    Truth,
    circles,
    design,
)
from benchmarks.trials.unmodelled_faults import Jump
from benchmarks.trials.verdict_cases.evidence_cases import EVIDENCE_CASES, write_evidence
from tympan.fem.film.laws import Ogden
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Plate, Specimen
from tympan.studies.columns import write_sheet
from tympan.studies.data.dataset import STATIC
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.effects import EFFECTS

FOLDER = Path(__file__).parent / "cases"


@dataclass(frozen=True)
class HiddenCase:
    """What is hidden: effects with their values in SI, or something no effect is.

    With ``coupons`` there are two films of a neo-Hookean law, and tests of that film. Of the
    specimen ``doubled`` the plate's diameter is written where its radius belongs.
    """

    name: str
    words: str
    verdict: tuple[str, ...]
    effects: tuple[tuple[str, float, str | None], ...] = ()
    stranger: Stranger = NOBODY
    coupons: coupon_readings.Film | None = None
    doubled: str = ""

    @property
    def written(self) -> list[Specimen]:
        """Specimens as the dataset has them."""
        def doubled(specimen: Specimen) -> Specimen:
            radius, _ = specimen.needed_plate().outline.semi_axes
            return replace(specimen, plate=Plate(Circle(2 * radius)))

        return [doubled(specimen) if specimen.name == self.doubled else specimen
                for specimen in self.design.setup.specimens]

    @property
    def design(self) -> Design:
        """What is read of actuators."""
        three = circles()
        if self.coupons is None:
            return three
        law = Ogden((coupon_readings.MODULUS,), (2.0,))
        return design(self.name, [replace(specimen, membrane=replace(
            specimen.membrane, material=law)) for specimen in three.setup.specimens[:2]],
                      voltages=np.linspace(0.0, 6500.0, 40))

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The effects."""
        return tuple(Cause(name, which) for name, _, which in self.effects)

    @property
    def truth(self) -> Truth:
        """With a film a little stiffer and less permittive than is stated."""
        sizes = tuple(EFFECTS[name].parameters[0].size(value) for name, value, _ in self.effects)
        return Truth(1.06, 0.97, self.causes, sizes, "equations", stranger=self.stranger)


NAMED, EITHER = ("named",), ("named", "ambiguous")
CASES = (
    HiddenCase("nothing", "nothing but noise, and a film 6 % stiffer than stated", ("nothing",)),
    HiddenCase("spring", "a spring of 4 N/m holds the plate", NAMED,
               (("parallel_spring", 4.0, None),)),
    HiddenCase("stiff-spring", "a spring of 40 N/m holds the plate", NAMED,
               (("parallel_spring", 40.0, None),)),
    HiddenCase("hook", "a hook of 1.5 g hangs with every weight", NAMED,
               (("unaccounted_mass", 1.5e-3, None),)),
    HiddenCase("zero", "the sensor was not zero at the flat film", NAMED,
               (("sensor_zero", 120e-6, None),)),
    HiddenCase("far-zero", "the sensor's zero is 2 mm off", NAMED,
               (("sensor_zero", 2e-3, None),)),
    HiddenCase("drift", "readings rise by 2 µm a minute", NAMED, (("drift", 2e-6 / 60, None),)),
    HiddenCase("loose-film", "one film has lost 3 % of its prestretch", NAMED,
               (("prestretch_loss", 0.03, "B"),)),
    # Of films that hardly grow (2 - n)/2 times the permittivity does the same: the equations with
    # it leave χ² = 0.1 of 90 readings.
    HiddenCase("falling-permittivity", "the permittivity falls with the area stretch, which is "
               "what a lower one would do", ("nothing",), (("permittivity_stretch", 0.6, None),)),
    HiddenCase("sagging-supply", "the supply sags under its load", EITHER,
               (("voltage_sag", 12e3, None),)),
    HiddenCase("wrong-gain", "the amplifier gives 5 % too much, which is what a higher "
               "permittivity would do", ("nothing",), (("amplifier_gain", 0.05, None),)),
    HiddenCase("two", "a spring of 5 N/m, and a sensor that was not zero", EITHER,
               (("parallel_spring", 5.0, None), ("sensor_zero", 200e-6, None))),
    HiddenCase("knocked", "the sensor was knocked half-way and reads 0.4 mm more from then on: no "
               "effect of the library", ("unexplained",), stranger=Jump(0.4e-3, 40)),
    # Of the actuators alone a permittivity that rises with stretch does as well.
    HiddenCase("softer-film", "the film hardens less than stated, which its coupons tell, though "
               "they are 2 % stiffer than its actuators", NAMED,
               (("strain_stiffening", -0.3, None),),
               coupons=coupon_readings.Film(hardening=-0.3, mounted=5**0.5)),
    HiddenCase("diameter", "the diameter of one plate is written where its radius belongs: no "
               "effect of the library", ("unexplained",), doubled="B"),
)


@dataclass(frozen=True)
class CouponCase:
    """What is hidden in coupons of a film: effects with their values in SI."""

    name: str
    words: str
    verdict: tuple[str, ...]
    film: coupon_readings.Film
    effects: tuple[tuple[str, tuple[float, ...]], ...] = ()
    in_time: bool = False

    @property
    def coupons(self) -> str:
        """The file of readings, with a noise of 1 % of the stress."""
        made = coupon_readings.in_time if self.in_time else coupon_readings.at_rest
        return made(self.film, 0.01, COUPON_CASES.index(self))


COUPON_CASES = (
    CouponCase("coupons-nothing", "nothing but noise, and a film 8 % stiffer than stated",
               ("nothing",), coupon_readings.Film()),
    CouponCase("coupons-warm", "the film softens by a hundredth a degree", NAMED,
               coupon_readings.Film(power=-3.0), (("temperature", (-3.0,)),)),
    CouponCase("coupons-held", "the grips hold 40 % of the width of strips said to be free", NAMED,
               coupon_readings.Film(held=0.4), (("width_not_free", (0.4,)),)),
    CouponCase("coupons-falling", "the permittivity falls with the area stretch", EITHER,
               coupon_readings.Film(falling=1.2), (("permittivity_stretch", (1.2,)),)),
    CouponCase("coupons-creep", "15 kPa of the film's stiffness relax within 200 s", NAMED,
               coupon_readings.Film(branch=(15e3, 200.0)), (("creep", (15e3, 200.0)),), True),
    CouponCase("coupons-second-invariant", "a tenth of the film's stress is Mooney's", NAMED,
               coupon_readings.Film(second=0.1), (("second_invariant", (0.1,)),)),
)


def readings(case: HiddenCase, design: Design) -> np.ndarray:
    """Readings with noise [m]."""
    shown = axisymmetric_readings.readings(design, case.truth)
    if shown is None:
        raise SystemExit(f"{case.name}: a state has no equilibrium")
    noise = NOISE * np.random.default_rng(CASES.index(case)).standard_normal(len(shown))
    return np.asarray(case.stranger.shown(shown, design.table.states) + noise)


def expected(case: HiddenCase) -> dict[str, object]:
    """What expected.json says."""
    parameters = {}
    for name, value, _ in case.effects:
        item = EFFECTS[name].parameters[0]
        parameters[name] = {item.name: {"value": item.shown(value), "unit": item.unit}}
    return {"hidden": case.words, "verdict": list(case.verdict),
            "causes": [] if case.verdict == ("nothing",) else [name for name, *_ in case.effects],
            "parameters": parameters}


def write_coupons(case: CouponCase, folder: Path) -> None:
    """A folder of coupons."""
    folder.mkdir(parents=True, exist_ok=True)
    head = coupon_readings.FILM.replace("film", case.name, 1)
    (folder / "dataset.toml").write_text(head, encoding="utf-8")
    (folder / "coupon.csv").write_text(case.coupons, encoding="utf-8")
    parameters = {name: {item.name: {"value": item.shown(value), "unit": item.unit}
                         for item, value in zip(EFFECTS[name].parameters, values, strict=True)}
                  for name, values in case.effects}
    content = {"hidden": case.words, "verdict": list(case.verdict),
               "causes": [name for name, _ in case.effects], "parameters": parameters}
    (folder / "expected.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def write(case: HiddenCase, folder: Path) -> None:
    """A case's folder."""
    made = case.design
    folder.mkdir(parents=True, exist_ok=True)
    head = (f'name = "{case.name}"\nsource = "axisymmetric equations"\n'
            f'noise = "{NOISE * 1e6:g} um"\n')
    specimens = "".join(
        "\n[[specimen]]\n" + specimen_to_toml(specimen).replace("\n[", "\n[specimen.")
        for specimen in case.written)
    (folder / "dataset.toml").write_text(head + specimens, encoding="utf-8")
    states = made.table.states
    names = [specimen.name for specimen in made.setup.specimens]
    columns = {"specimen": [names[number] for number in states.specimen.tolist()],
               "mass": states.mass, "voltage": states.voltage, "elapsed": states.elapsed,
               "order": made.table.order, "displacement": readings(case, made)}
    write_sheet(folder / "static.csv", [column for column in STATIC if column.name in columns],
                columns)
    if case.coupons is not None:
        (folder / "coupon.csv").write_text(
            coupon_readings.at_rest(case.coupons, 0.02, CASES.index(case)), encoding="utf-8")
    (folder / "expected.json").write_text(json.dumps(expected(case), indent=1) + "\n",
                                          encoding="utf-8")


if __name__ == "__main__":
    for hidden in CASES:
        write(hidden, FOLDER / hidden.name)
    for strips in COUPON_CASES:
        write_coupons(strips, FOLDER / strips.name)
    for more in EVIDENCE_CASES:
        write_evidence(more, FOLDER / more.name)
