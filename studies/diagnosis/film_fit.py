"""A film fitted to readings of its actuators: stiffness, permittivity, branches in time.

The law keeps its stated form. All evidence is judged by the nominal fit of a diagnosis:
deflections, forces that hold plates, frequencies, scans, runs in time, with coupons beside them.
Branches are those of the effect ``creep``, found by the reduced films and the search of a
diagnosis, with no other effect.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from scipy.special import chdtrc

from tympan.base.errors import InputError
from tympan.base.fields import MAY_MISS, Key
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.specimen import Material
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.calibration import Calibration
from tympan.studies.diagnosis.diagnose import (
    calibrated_readings,
    judge_coupons,
    of_coupons_alone,
    with_coupons,
)
from tympan.studies.diagnosis.evidence.kind import ReadingModel
from tympan.studies.diagnosis.fits.evidence import interval
from tympan.studies.diagnosis.fits.fit import NUISANCE, Fit
from tympan.studies.diagnosis.fits.fitting import nominal_fit
from tympan.studies.diagnosis.hypothesis import FACTORS, Cause
from tympan.studies.diagnosis.inference.exploration import COUNT, Exploration
from tympan.studies.diagnosis.inference.families import found_sizes
from tympan.studies.diagnosis.inference.nominal import with_noise_found
from tympan.studies.diagnosis.law_fit import constants_of_least_cost
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.result import Factor, Json
from tympan.studies.effects.findings import FoundSize
from tympan.studies.files import remove, to_json, words_beside, write_json, write_text

#: Sentences, by key.
WORDS = words_beside(__file__)

#: Half width of 95 % limits, in standard deviations.
TWO_SIDED = 1.96

#: Most branches fitted.
MOST = 2

#: p-value of a fit's residuals below which they are more than noise.
_ADEQUATE = 0.01
#: Correlation from which on only a combination of two constants is determined.
_TOGETHER = 0.95
#: Upper over lower limit from which on a branch's time is hardly determined.
_WIDE = 30.0
#: Width of a factor's limits over the limits before any reading, from which on readings add little.
_BEFOREHAND = 0.5


@dataclass(frozen=True)
class FittedConstant:
    """A constant with its 95 % limits, widened where the residuals are more than noise."""

    value: Annotated[float, Key("the most probable one")]
    low: Annotated[float | None, Key("lower 95 % limit")]
    high: Annotated[float | None, Key("upper 95 % limit")]

    @classmethod
    def of(cls, size: FoundSize) -> FittedConstant:
        """Take the constant that is a parameter of an effect."""
        return cls(size.value, *(limit if np.isfinite(limit) else None
                                 for limit in (size.low, size.high)))


@dataclass(frozen=True)
class FittedBranch:
    """A viscous branch beside the law."""

    modulus_Pa: Annotated[FittedConstant, Key("its modulus")]
    time_s: Annotated[FittedConstant, Key("its time")]


@dataclass(frozen=True)
class LawConstant(FittedConstant):
    """A constant of the law; ``value`` includes the factor on stiffness."""

    name: Annotated[str, Key("key of the law, numbered where it is a list")]
    unit: Annotated[str, Key("of the value: Pa, or none")]


@dataclass(frozen=True)
class FittedForm:
    """The law with its constants fitted, each by itself."""

    constants: Annotated[tuple[LawConstant, ...], Key("of the law, those that were kept too")]
    permittivity_factor: Annotated[Factor, Key("on the permittivity of every film, beside them")]
    misfit: Annotated[float, Key("root of χ² per degree of freedom, at least 1")]
    p_value: Annotated[float, Key("probability by noise alone of what the fit leaves, or more")]


@dataclass(frozen=True, kw_only=True)
class FilmFit:
    """Result of ``material fit`` on a dataset; ``files`` are specimens by name."""

    indexed: ClassVar[tuple[str, ...]] = ("constant",)

    dataset: Annotated[str, Key("name of the dataset")]
    readings: Annotated[int, Key("how many were fitted: means of blocks of samples and others")]
    stiffness_factor: Annotated[Factor, Key("on the law of every film")]
    permittivity_factor: Annotated[Factor, Key("on the permittivity of every film")]
    branches: Annotated[tuple[FittedBranch, ...], Key("beside the law, the fastest first")]
    law: Annotated[FittedForm | None, Key(
        "the law's constants, where they were asked for; factors, misfit and p_value beside it are "
        "those of the law as stated"), MAY_MISS] = None
    misfit: Annotated[float, Key("root of χ² per degree of freedom, at least 1: limits are widened "
                                 "by it")]
    p_value: Annotated[float, Key("probability by noise alone of what the fit leaves, or more")]
    not_told: Annotated[tuple[str, ...], Key("what these readings do not tell, in sentences")]
    warnings: Annotated[tuple[str, ...], Key("what limits the result, in sentences")]
    files: Mapping[str, str] = field(default_factory=dict, repr=False, compare=False)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each constant."""
        return [{"constant": name, "unit": unit, **asdict(size)}
                for name, unit, size in self.constants]

    @property
    def constants(self) -> list[tuple[str, str, Factor | FittedConstant]]:
        """Name, unit, and value with limits of each constant."""
        branches = [each for number, branch in enumerate(self.branches, 1)
                    for each in ((f"modulus of branch {number}", "Pa", branch.modulus_Pa),
                                 (f"time of branch {number}", "s", branch.time_s))]
        law = [(each.name, each.unit, each) for each in (self.law.constants if self.law else ())]
        return [("stiffness factor", "", self.stiffness_factor),
                ("permittivity factor", "", self.permittivity_factor), *branches, *law]

    def json(self) -> Json:
        """Write the fit as a JSON object."""
        record: Json = to_json(self)
        return record

    def save(self, folder: Path) -> None:
        """Write film_fit.json and every specimen with its fitted film."""
        remove(folder, "film_fit.json")
        for name, text in self.files.items():
            write_text(folder / name, text)
        write_json(folder / "film_fit.json", self.json())


def fit_film(dataset: Dataset, branches: int | None = None, seed: int = 0,
             constants: Sequence[str] = ()) -> FilmFit:
    """Fit one factor on stiffness, one on permittivity and viscous branches to all readings.

    ``branches`` is their number. None takes as many as are more probable than fewer, at most
    :data:`MOST`, and none without runs in time. Noise that is not stated is estimated from the
    fit's scatter. ``seed`` is that of the random draws by which coupons are judged. ``constants``
    are keys of the law, such as ``mu``, or "all", whose constants are fitted each by itself, to
    readings at rest alone. An :class:`InputError` where readings do not determine such a branch, or
    are of coupons alone.
    """
    if of_coupons_alone(dataset):
        raise InputError("must have readings of an actuator; of coupons alone give the file "
                         "coupon.csv, to which laws are fitted", key=dataset.name)
    if branches and dataset.transients is None:
        raise InputError("must be 0, as there is no transient.csv: branches show in time alone",
                         key="--branches", given=branches)
    if branches is not None and branches > MOST:
        raise InputError(f"must be from 0 to {MOST} for a dataset's transients", key="--branches",
                         given=branches)
    if constants:
        _law_may_be_fitted(dataset)
    readings, nominal, _ = calibrated_readings(dataset)
    table = readings.table
    simulation: ReadingModel = nominal.simulation
    try:
        if dataset.coupons is not None:
            readings, simulation, table = with_coupons(readings, nominal.simulation,
                                                       judge_coupons(dataset, seed), ())
        if readings.coupons is None and dataset.transients is None:
            table = with_noise_found(simulation, table, ())
    except ArithmeticError as failure:
        raise InputError(str(failure), key="readings", given=f"{len(table)} readings") from None
    best = nominal_fit(simulation, table)
    if dataset.transients is not None:
        search = Exploration(simulation, table, best, [Cause("creep")], lambda fit: True)
        search.run()
        simulation = search.simulation
        fits = {len(fit.hypothesis): fit for fit in (search.nominal, *search.ranked())}
        best = max(fits.values(), key=lambda fit: fit.evidence - COUNT * len(fit.hypothesis))
        if branches is not None:
            if branches not in fits:
                raise InputError("must be fewer: these readings tell no such branch",
                                 key="--branches", given=branches)
            best = fits[branches]
    result = _result(dataset, simulation, best, readings.remarks)
    return _with_law(result, dataset, table, constants) if constants else result


def _law_may_be_fitted(dataset: Dataset) -> None:
    """Refuse datasets of films with several laws, and readings that depend on more than a law."""
    if len({specimen.membrane.material for specimen in dataset.specimens}) > 1:
        raise InputError("must not be given: the specimens have different laws", key="--constants")
    for there, name, what in ((dataset.coupons, "coupon.csv", "laws are fitted to that file by "
                               "itself"), (dataset.transients, "transient.csv", "what creeps would "
                                           "be taken for the law")):
        if there is not None:
            raise InputError(f"must not be given: there is {name}: {what}", key="--constants")


def _with_law(result: FilmFit, dataset: Dataset, table: ReadingTable, kinds: Sequence[str]
              ) -> FilmFit:
    """Add the fitted constants of the law to a result, and the films made with them."""
    first = dataset.specimens[0].membrane

    def calibrated(law: Material) -> Calibration:
        films = tuple(replace(specimen, membrane=replace(specimen.membrane, material=law))
                      for specimen in dataset.specimens)
        return calibrated_readings(replace(dataset, specimens=films))[1]

    try:
        found = constants_of_least_cost(first.material, first.prestretch, kinds,
                        lambda law: nominal_fit(calibrated(law).simulation, table))
    except ArithmeticError as failure:
        raise InputError(str(failure), key="readings", given=f"{len(table)} readings") from None
    fit, constants = found.fit, []
    for name, stress, value, deviation in zip(
            found.constants.names, found.constants.stress, found.values.tolist(),
            found.deviations.tolist(), strict=True):
        around = (value - TWO_SIDED * deviation, value + TWO_SIDED * deviation)
        constants.append(LawConstant(value, *around, name, "Pa" if stress else ""))
    freedom = max(len(fit.residual) - len(fit.unknowns) - np.count_nonzero(found.told), 1)
    known = fit.louder(fit.misfit)
    form = FittedForm(tuple(constants), Factor(*np.exp(interval(known, 1)).tolist()), fit.misfit,
                      float(chdtrc(freedom, fit.chi_squared)))
    hardly = [WORDS["beforehand"].format(name=name) for name, told
              in zip(found.constants.names, found.told, strict=True) if told > _BEFOREHAND]
    either = [WORDS["either"].format(name=each.name) for each in constants
              if each.low is not None and each.high is not None and each.low < 0 < each.high]
    specimens = calibrated(found.law).simulation.extended(fit.hypothesis, fit.unknowns).specimens
    return replace(result, law=form, not_told=(*result.not_told, *hardly, *either),
                   warnings=tuple(words for words in result.warnings if words != WORDS["form"]),
                   files={f"{specimen.name}.toml": specimen_to_toml(specimen)
                          for specimen in specimens})


def _result(dataset: Dataset, simulation: ReadingModel, fit: Fit, remarks: tuple[str, ...]
            ) -> FilmFit:
    known, freedom = fit.louder(fit.misfit), len(fit.residual) - len(fit.unknowns)
    chance = float(chdtrc(max(freedom, 1), fit.chi_squared))
    factors = [Factor(*np.exp(interval(known, number)).tolist()) for number in range(FACTORS.stop)]
    sizes = sorted((found_sizes(known, cause) for cause in fit.hypothesis),
                   key=lambda size: size["tau"].value)
    beware = [WORDS["more"].format(misfit=fit.misfit)] if chance < _ADEQUATE else []
    extended = simulation.extended(fit.hypothesis, fit.unknowns)
    return FilmFit(
        dataset=dataset.name, readings=len(fit.residual), stiffness_factor=factors[0],
        permittivity_factor=factors[1], branches=tuple(FittedBranch(
            FittedConstant.of(size["mu"]), FittedConstant.of(size["tau"])) for size in sizes),
        misfit=fit.misfit, p_value=chance,
        not_told=tuple(_not_told(known, sizes, dataset.transients is not None)),
        warnings=(*remarks, *beware, WORDS["form"]),
        files={f"{specimen.name}.toml": specimen_to_toml(specimen)
               for specimen in extended.specimens})


def _not_told(fit: Fit, sizes: list[dict[str, FoundSize]], in_time: bool) -> Iterator[str]:
    """Name the constants that the readings, some of them ``in_time``, do not determine."""
    names = ["stiffness", "permittivity"]
    for cause in fit.hypothesis:
        number = 1 + [size["mu"].value for size in sizes].index(found_sizes(fit, cause)["mu"].value)
        names += [f"modulus of branch {number}", f"time of branch {number}"]
    for name, deviation, before in zip(names, fit.deviations, NUISANCE, strict=False):
        if deviation > _BEFOREHAND * before:
            yield WORDS["beforehand"].format(name=name)
    for number, size in enumerate(sizes, 1):
        if not size["mu"].low:
            yield WORDS["none"].format(number=number)
        if size["tau"].high > _WIDE * size["tau"].low:
            yield WORDS["wide"].format(number=number, time=size["tau"])
    spread = np.maximum(fit.deviations, 1e-300)
    correlation = fit.covariance / spread / spread[:, None]
    for first, second in combinations(range(len(names)), 2):
        if abs(correlation[first, second]) > _TOGETHER:
            yield WORDS["together"].format(first=names[first], second=names[second],
                                           correlation=correlation[first, second])
    if not sizes:
        yield WORDS["no_branch" if in_time else "at_rest"]
