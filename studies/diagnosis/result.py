"""A diagnosis as a result: plain data, as JSON, in a folder and read back from one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from tympan.base.arrays import Columns
from tympan.base.errors import InputError
from tympan.base.fields import IN_UNIT, MAY_MISS, Key, Printed
from tympan.studies.columns import Column, as_written, read_own_sheet, write_sheet
from tympan.studies.data.checked_runs import Hum, LateRun
from tympan.studies.data.coupon import MODES
from tympan.studies.data.findings import Finding
from tympan.studies.files import (
    from_json,
    read_json,
    read_text,
    to_json,
    write_json,
    write_text,
)
from tympan.studies.film_surface import FilmSurface

Json = dict[str, Any]
Verdict = Literal["nothing", "named", "ambiguous", "unexplained"]

READINGS = "readings.csv"
CURVES = "curves.csv"
CHANNELS = "channels.csv"
STRIPS = "strips.csv"

#: Columns of each table, in SI. Readings: the measured value, both models' predictions, and whether
#: the reading counts (1) or is an outlier (0). Curves: the predictions of both models at voltages
#: between, reached up (1) or down (-1), and the limits of the band, nan where there is no
#: equilibrium. The same for other kinds of readings than lengths, in the ``unit`` of the row, for
#: forces at displacements between. Readings of coupons, instead of all these.
TABLES: Mapping[str, tuple[Column, ...]] = {
    READINGS: (
        Column.labels("file", required=False), Column("line"), Column.labels("kind"),
        Column.labels("specimen"), Column("mass", "g"), Column("voltage", "kV"),
        Column("elapsed", "s"), Column.labels("run", required=False),
        *(Column(name, required=False, absent="nan")
          for name in ("order", "read", "sigma", "baseline", "extended", "counts")),
        Column("x", "mm", required=False), Column("y", "mm", required=False),
        Column("displacement", "mm", required=False)),
    CHANNELS: (
        Column.labels("kind"), Column.labels("specimen"), Column("mass", "g"),
        Column("voltage", "kV"), Column("displacement", "mm", required=False, absent="nan"),
        Column("direction"), Column.labels("unit", required=False),
        *(Column(name, required=False, absent="nan")
          for name in ("baseline", "extended", "low", "high"))),
    CURVES: (
        Column.labels("kind"), Column.labels("specimen"), Column("mass", "g"),
        Column("voltage", "kV"), Column("direction"),
        *(Column(name, "mm", required=False, absent="nan")
          for name in ("baseline", "extended", "low", "high"))),
    STRIPS: (
        Column("line"), Column.labels("specimen"), Column.labels("run", required=False),
        Column("leg"), Column.labels("mode", tuple(MODES)),
        Column("t", "s", required=False, absent="nan"), Column("stretch"),
        Column("voltage", "kV"), Column("temperature_C"),
        *(Column(name, "kPa", required=False, absent="nan")
          for name in ("read", "sigma", "baseline", "extended")))}

#: Folder of the diagnosis of coupons in that of actuators.
COUPONS = "coupons"
#: The folder of films.
_FILMS = "films"
#: The folder of the extended model.
_EXTENDED = "extended"


@dataclass(frozen=True)
class ShownSize:
    """A parameter of an effect as people read it."""

    value: Annotated[float | None, Key("in its unit")]
    unit: Annotated[str, Key("unit of value and limits")]
    low: Annotated[float | None, Key("lower 95 % limit")]
    high: Annotated[float | None, Key("upper 95 % limit")]
    words: Annotated[str, Key("what numbers do not say")]


@dataclass(frozen=True, kw_only=True)
class FoundFamily:
    """Causes that these readings do not distinguish; one of them was found."""

    name: Annotated[str, Key("name of the family")]
    headline: Annotated[str, Key("what all of them mean here")]
    size: Annotated[ShownSize, Key("what they have in common")]
    members: Annotated[tuple[str, ...], Key("effects of the library that belong to it")]
    member: Annotated[str, Key("what it means if it is the one found, which the extended model "
                               "has")]


@dataclass(frozen=True, kw_only=True)
class FoundCause:
    """A possible cause, given that something is wrong."""

    effect: Annotated[str, Key("name of the effect")]
    which: Annotated[str | None, Key("the specimen it happens to; none for all")] = None
    again: Annotated[bool, Key("whether it is there beside the same effect of other sizes")] = False
    probability: Annotated[float, Key("probability of the cause, given that something is wrong")]
    in_library: Annotated[float | None, Key(
        "its share of the probability of all effects in the library, alone and in pairs, by which "
        "it may be named")] = None
    headline: Annotated[str, Key("what it means here")]
    clear: Annotated[bool, Key("whether its sign is certain")] = True
    check: Annotated[str, Key("what to look at on the bench")]
    surprise: Annotated[float | None, Key("its size over the usual one")] = None
    only_its_size: Annotated[bool, Key("whether only its size speaks against it")] = False
    others: Annotated[tuple[str, ...], Key("other effects of the same hypothesis"),
        Printed("with")] = ()
    named: Annotated[bool, Key("whether it stands out")] = False
    parameters: Annotated[dict[str, ShownSize], Key("sizes by the parameter's name")] = field(
        default_factory=dict)
    family: Annotated[FoundFamily | None, Key(
        "what it stands for, where these readings do not tell it from others")] = None
    widened: Annotated[float, Key("factor on the limits of its sizes: the root of what it leaves "
                                  "per degree of freedom (χ²) where nothing explains the readings, "
                                  "else 1")] = 1.0


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """An effect fitted alone, with hardly any prior."""

    effect: Annotated[str, Key("name of the effect")]
    which: Annotated[str | None, Key("the specimen it happens to; none for all")]
    explains: Annotated[float, Key("share of the misfit it takes away")]
    parameters: Annotated[dict[str, ShownSize], Key("sizes by the parameter's name")]
    headline: Annotated[str, Key("what it would mean")]
    prior_widths: Annotated[float, Key("its size over the usual one")]
    plausible: Annotated[bool, Key("whether that size is usual")]
    at_limit: Annotated[bool, Key("whether it would want more than physics allows")]
    widened: Annotated[float, Key("factor on the limits of its sizes: the root of what it leaves "
                                  "per degree of freedom (χ²) where nothing explains the readings, "
                                  "else 1")] = 1.0


@dataclass(frozen=True, kw_only=True)
class Ratio:
    """A ratio of two strokes."""

    kind: Annotated[Literal["shape", "mass"], Key("what is compared")]
    what: Annotated[str, Key("the ratio in plain words")]
    read: Annotated[float, Key("ratio of the readings")]
    simulated: Annotated[float, Key("ratio of the nominal model")]
    noise: Annotated[float, Key("standard deviation of the ratio read")]
    off_by_noise: Annotated[float, Key("their difference over it")]


@dataclass(frozen=True)
class PatternTest:
    """A test of one pattern of misfit."""

    what: Annotated[str, Key("what may be wrong, in plain words")]
    p_value: Annotated[float, Key("probability of so much by noise alone")]


@dataclass(frozen=True, kw_only=True)
class ReadingOff:
    """An outlier, which does not count."""

    file: Annotated[str, Key("file it is written in")]
    line: Annotated[int, Key("line of the file")]
    kind: Annotated[str, Key("what was read")]
    specimen: Annotated[str, Key("name of the specimen")]
    unit: Annotated[str, Key("unit of read and expected")]
    read: Annotated[float, Key("what is written, in its unit")]
    expected: Annotated[float, Key("what the model makes of it by the other readings")]
    probability: Annotated[float, Key("probability that it is off by itself")]


@dataclass(frozen=True, kw_only=True)
class ReadingsOfKind:
    """Readings of another kind than the first, such as forces."""

    kind: Annotated[str, Key("what was read")]
    unit: Annotated[str, Key("unit of the errors")]
    readings: Annotated[int, Key("how many there are")]
    noise: Annotated[float, Key("standard deviation of one, in the unit")]


@dataclass(frozen=True, kw_only=True)
class MisfitOfKind(ReadingsOfKind):
    """Misfit of the nominal model in readings of another kind."""

    baseline_rmse: Annotated[float, Key("root mean square of what the nominal model misses")]


@dataclass(frozen=True, kw_only=True)
class Misfit:
    """Misfit of the nominal model, its stiffness and permittivity fitted."""

    baseline_rmse: Annotated[float, Key("root mean square of what the nominal model misses"),
        IN_UNIT]
    noise: Annotated[float, Key("standard deviation of one reading"), IN_UNIT]
    noise_from: Annotated[str, Key("where the noise is from")]
    noise_stated: Annotated[float | None, Key(
        "standard deviation of one reading as the files state it, the root mean square where they "
        "state several; none where they state none"), IN_UNIT] = None
    noise_over_stated: Annotated[float | None, Key("what readings scatter by, over the noise "
                                                   "stated")]
    p_value: Annotated[float, Key("probability of so much misfit by noise alone")]
    p_value_of_all: Annotated[float | None, Key(
        "the same with readings that are off by themselves, and as if errors did not remember; "
        "none where that is the same")] = None
    correlation: Annotated[float, Key("of the errors of readings made one after the other, where "
                                      "they remember")] = 0.0
    counts_below: Annotated[float | None, Key(
        "where no noise is stated: if the noise of a reading is below this, the misfit is not a "
        "sensor that wanders; none where a noise is stated, or none explains it"), IN_UNIT
    ] = None
    where: Annotated[str, Key("where the misfit is, in plain words")]
    ratios: Annotated[tuple[Ratio, ...], Key("ratios of strokes, measured and simulated")] = ()
    patterns: Annotated[tuple[PatternTest, ...], Key("tests of what may be wrong")] = ()
    others: Annotated[tuple[MisfitOfKind, ...], Key(
        "the same of readings of other kinds, such as forces")] = ()


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Prediction of held-out readings."""

    coverage_95: Annotated[float | None, Key("share of them within their 95 % bands")]
    readings: Annotated[int, Key("how many there are")]
    pit: Annotated[tuple[int, ...], Key("counts of where they lie in their bands, in tenths")]


@dataclass(frozen=True, kw_only=True)
class HeldOut:
    """Errors on one held-out part of the readings."""

    held_out: Annotated[str, Key("the part")]
    chosen: Annotated[tuple[str, ...], Key("causes chosen on the rest")]
    wrong: Annotated[tuple[str, ...], Key("the best other causes")]
    rmse: Annotated[dict[str, float | None], Key(
        "errors there: before, after, process (a smooth curve), rival (wrong), noise"),
        IN_UNIT]
    note: Annotated[str, Key("why it does not count, if so")]


@dataclass(frozen=True, kw_only=True)
class GainOfKind(ReadingsOfKind):
    """Errors on readings of another kind than the first, on all held-out parts that count."""

    rmse_before: Annotated[float, Key("error of the nominal model, in the unit")]
    rmse_after: Annotated[float, Key("error of the extended model, in the unit")]


@dataclass(frozen=True, kw_only=True)
class Gain:
    """The gain of the extended model over the nominal one on held-out readings."""

    held_out: Annotated[str, Key("what was held out")]
    rmse_before: Annotated[float | None, Key("error of the nominal model"), IN_UNIT]
    rmse_after: Annotated[float | None, Key("error of the extended model"), IN_UNIT]
    ratio: Annotated[float | None, Key("ratio of what noise does not explain")]
    low: Annotated[float | None, Key("lower 95 % limit; none where ramps are too few")]
    high: Annotated[float | None, Key("upper 95 % limit")]
    splits: Annotated[tuple[HeldOut, ...], Key("one for each part held out")] = ()
    impossible: Annotated[tuple[str, ...], Key("parts that cannot be held out, and why")] = ()
    others: Annotated[tuple[GainOfKind, ...], Key(
        "errors on readings of other kinds, such as forces")] = ()


@dataclass(frozen=True, kw_only=True)
class ProposedExperiment:
    """An experiment that may be made next."""

    what: Annotated[str, Key("what to do, in plain words")]
    separates: Annotated[tuple[str, ...], Key("effects it tells apart")]
    expected_chi_squared: Annotated[float, Key("expected χ² of their difference")]
    enough: Annotated[bool, Key("whether that is odds of a hundred to one")]
    minutes: Annotated[float, Key("minutes of work")]


@dataclass(frozen=True, kw_only=True)
class NextExperiment:
    """Proposal for the next experiment."""

    what: Annotated[str, Key("what to do, in plain words")]
    checks: Annotated[tuple[str, ...], Key("what to look at first, on the bench")]
    after_checks: Annotated[str, Key("what to read then")]
    separates: Annotated[tuple[str, ...], Key("effects it tells apart")] = ()
    expected_chi_squared: Annotated[float | None, Key("expected χ² of their difference")] = None
    menu: Annotated[tuple[ProposedExperiment, ...], Key(
        "experiments, those that tell most per minute first")] = ()


@dataclass(frozen=True)
class NoEffect:
    """Probabilities of hypotheses without an effect of the library."""

    nothing: Annotated[float, Key("probability that nothing is wrong")]
    unknown: Annotated[float, Key("probability of something smooth that no effect makes, or of "
                                  "nothing that stands out from small errors")]


@dataclass(frozen=True, kw_only=True)
class After:
    """The extended model."""

    rmse: Annotated[float, Key("root mean square of what it misses"), IN_UNIT]
    p_value: Annotated[float | None, Key("probability of so much misfit by noise alone")]
    effects: Annotated[tuple[str, ...], Key("what it is extended by")]


@dataclass(frozen=True)
class Factor:
    """A factor on a value stated in the dataset."""

    value: Annotated[float, Key("found over stated")]
    low: Annotated[float, Key("lower 95 % limit")]
    high: Annotated[float, Key("upper 95 % limit")]


@dataclass(frozen=True)
class Noisier:
    """Verdict under a larger noise."""

    factor: Annotated[float, Key("factor on the noise")]
    probability: Annotated[float | None, Key("probability of what is named, then")]


@dataclass(frozen=True)
class Robust:
    """Verdict with other prior scales of the effects."""

    factor: Annotated[float, Key("factor on the usual sizes")]
    stand_out: Annotated[tuple[str, ...], Key("causes that stand out, then")]
    unknown: Annotated[float | None, Key("probability of none of the library, then; none where "
                                         "small errors explain the rest")] = None


@dataclass(frozen=True, kw_only=True)
class Knowable:
    """Least detectable size of an effect on these readings; none if no allowed size is enough."""

    effect: Annotated[str, Key("name of the effect")]
    parameter: Annotated[str, Key("name of its parameter")]
    unit: Annotated[str, Key("unit of the sizes")]
    seen_from: Annotated[float | None, Key("smallest size to be noticed")]
    told_from: Annotated[float | None, Key("smallest size to be told from all others")]
    rival: Annotated[str | None, Key("the effect most like it")]
    prior_width: Annotated[float, Key("its usual size")]


@dataclass(frozen=True, eq=False)
class LoadedFilm:
    """A film of the extended model, or of the fitted nominal one where nothing extends it.

    Its load is one of the readings'. ``film`` has its fields and the ``nominal_deflection`` [m] of
    the fitted nominal model; it is stored in a file of its own.
    """

    specimen: Annotated[str, Key("name of the specimen")]
    mass_kg: Annotated[float, Key("nominal load on the plate")]
    voltage_V: Annotated[float, Key("nominal voltage")]
    film: FilmSurface | None = field(default=None, repr=False, compare=False)

    def loaded(self, folder: Path) -> LoadedFilm:
        """Read the entry's film that was stored in a folder."""
        file = folder / f"{self.specimen}.vtu"
        film = FilmSurface.load(file)
        if "nominal_deflection" not in film.values:
            raise InputError("is of an older version: run tympan diagnose again", file=file)
        return replace(self, film=film)


@dataclass(frozen=True, kw_only=True, eq=False)
class Diagnosis:
    """The result of a diagnosis, as it is printed, drawn and stored.

    ``tables``: the columns of the files in :data:`TABLES`, in SI; ``extended``: the text of the
    extended model's files by their names; ``coupons``: the diagnosis of coupons of the same films,
    None where there are no coupons or nothing else. ``unit``: that of errors, "um" or "kPa"; keys
    of errors end in it.
    """

    dataset: Annotated[str, Key("name of the dataset")]
    verdict: Annotated[Verdict, Key("nothing beyond noise; one cause stands out; several could; "
                                    "none in the library mends it")]
    headline: Annotated[str, Key("the verdict in a sentence")]
    cannot_tell: Annotated[str, Key("why it is not known whether the simulation agrees; empty "
                                    "where it is known")] = ""
    causes: Annotated[tuple[FoundCause, ...], Key("causes, the most probable first")] = ()
    findings: Annotated[tuple[Finding, ...], Key(
        "what is wrong with the dataset itself: its rows, its labels, its quantities")] = ()
    together: Annotated[bool, Key("whether the causes act together")] = False
    indistinguishable: Annotated[tuple[tuple[str, ...], ...], Key(
        "groups of effects that these readings cannot tell apart")] = ()
    misfit: Annotated[Misfit, Key("misfit of the nominal model, its stiffness and permittivity "
                                  "fitted")]
    readings_off: Annotated[tuple[ReadingOff, ...], Key(
        "readings that are off by themselves, and do not count")] = ()
    predictive: Annotated[Coverage | None, Key("how readings held out were predicted")] = None
    gain: Annotated[Gain | None, Key("gain of the extended model over the nominal one, on readings "
                                     "held out")] = None
    next_experiment: Annotated[NextExperiment | None, Key("what to do next")] = None
    not_visible: Annotated[tuple[str, ...], Key("effects that a refit takes up")] = ()
    probability: Annotated[NoEffect, Key("probabilities of what is no effect")]
    attempts: Annotated[tuple[Attempt, ...], Key("every effect alone, with hardly any prior")] = ()
    after: Annotated[After | None, Key("the extended model")] = None
    baseline: Annotated[dict[str, Factor], Key(
        "what was fitted of the nominal model: stiffness_factor, permittivity_factor")]
    noisier: Annotated[Noisier, Key("what a larger noise would change")]
    small_errors: Annotated[float | None, Key(
        "share of its usual size at which every other cause is there, where that accounts for the "
        "rest")] = None
    robust: Annotated[tuple[Robust, ...], Key("what stands out with other usual sizes")] = ()
    model_error: Annotated[float, Key("largest error of the reduced model against finite elements"),
        IN_UNIT] = 0.0
    knowable: Annotated[tuple[Knowable, ...], Key("what these readings can tell")] = ()
    self_check: Annotated[Json | None, Key("what comes of synthetic readings like these")] = None
    hum: Annotated[tuple[Hum, ...], Key("steady lines of runs in time, subtracted")] = ()
    late_runs: Annotated[tuple[LateRun, ...], Key("runs in time whose clocks are off")] = ()
    warnings: Annotated[tuple[str, ...], Key("what limits the result, in sentences")] = ()
    films: Annotated[Json, Key("plans of the films that were scanned, by specimen")] = field(
        default_factory=dict)
    loaded_films: Annotated[tuple[LoadedFilm, ...], Key(
        "films in the folder films, solved by finite elements")] = ()
    coupon_reading: Annotated[str | None, Key(
        "of coupons: what was judged, the stress or its drop"), MAY_MISS] = None
    unit: str = field(default="um", compare=False)
    tables: Mapping[str, Columns] = field(default_factory=dict, repr=False, compare=False)
    extended: Mapping[str, str] = field(default_factory=dict, repr=False, compare=False)
    coupons: Diagnosis | None = field(default=None, repr=False, compare=False)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each parameter of each cause."""
        return [{"effect": cause.effect, "which": cause.which, "probability": cause.probability,
                 "parameter": name, **asdict(size)}
                for cause in self.causes for name, size in cause.parameters.items()]

    @property
    def said(self) -> str:
        """First sentences for a reader: the headline, and what to look at on the bench."""
        checks = self.next_experiment.checks if self.next_experiment else ()
        return "; ".join((self.headline, *checks))

    def json(self) -> Json:
        """Build the JSON object that the command prints."""
        record: Json = to_json(self, self.unit)
        return record | ({"coupons": self.coupons.json()} if self.coupons else {})

    def save(self, folder: Path) -> None:
        """Write the tables, the films, the extended model and, last, diagnosis.json to a folder.

        The diagnosis of coupons of the same films is written to a folder in it.
        """
        if self.coupons is not None:
            self.coupons.save(folder / COUPONS)
        for name, table in self.tables.items():
            write_sheet(folder / name, TABLES[name], table)
        for item in self.loaded_films:
            if item.film is not None:
                item.film.save(folder / _FILMS / f"{item.specimen}.vtu")
        for name, text in self.extended.items():
            write_text(folder / _EXTENDED / name, text)
        write_json(folder / "diagnosis.json", self.json())

    def as_stored(self) -> Diagnosis:
        """Round the result to the digits of its files."""
        return replace(
            self, tables={name: as_written(TABLES[name], table)
                          for name, table in self.tables.items()},
            coupons=None if self.coupons is None else self.coupons.as_stored())

    @classmethod
    def load(cls, folder: Path) -> Diagnosis:
        """Load a saved diagnosis; raise an :class:`InputError` if an older version wrote it."""
        file = folder / "diagnosis.json"
        content = from_json(Json, read_json(file), file)
        if "headline" not in content:
            raise InputError("is of an older version: run tympan diagnose again", file=file)
        misfit = from_json(Json, content.get("misfit"), file, "misfit")
        unit = "kPa" if "noise_kPa" in misfit else "um"
        stored = from_json(cls, content, file, unit=unit)
        names = [STRIPS] if (folder / STRIPS).exists() else [
            READINGS, CURVES, *([CHANNELS] if (folder / CHANNELS).exists() else [])]
        return replace(
            stored, unit=unit,
            tables={name: read_own_sheet(folder / name, TABLES[name]) for name in names},
            loaded_films=tuple(item.loaded(folder / _FILMS) for item in stored.loaded_films),
            extended={model.name: read_text(model)
                      for model in sorted((folder / _EXTENDED).glob("*"))},
            coupons=cls.load(folder / COUPONS) if (folder / COUPONS).is_dir() else None)
