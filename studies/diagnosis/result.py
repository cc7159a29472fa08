"""A diagnosis as a result: everything computed, as JSON, in a folder and read back from one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.toml_writer import rig_to_toml, specimen_to_toml
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.data.checks import dataset_warnings
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.coupons.coupon_record import (
    COUPON_COLUMNS,
    COUPON_FILE,
    at_temperature,
    save_coupons,
)
from tympan.studies.diagnosis.fits.evidence import interval
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.gain import GainReport, gain_of
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.identifiability import detectable_effects
from tympan.studies.diagnosis.inference.posterior import Posterior
from tympan.studies.diagnosis.inference.ratios import ratios
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.next_experiment.experiments import MENU
from tympan.studies.diagnosis.next_experiment.proposals import AnyExperiment, Proposal, propose
from tympan.studies.diagnosis.next_experiment.solved_experiments import SOLVED
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.readings import PreparedReadings
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.self_check import Bench
from tympan.studies.diagnosis.sentences import (
    WORDS,
    found_sizes,
    headline,
    next_step,
    slip,
    suspects_among,
    together,
    told,
    where,
)
from tympan.studies.diagnosis.shown.curves import CURVES, curves
from tympan.studies.diagnosis.shown.loaded_films import LoadedFilm, loaded_films
from tympan.studies.effects import Setup
from tympan.studies.files import read_json, write_json, write_text

Array = NDArray[np.float64]
Json = dict[str, Any]

#: The columns of readings.csv: what was read, and what both models say [SI].
COLUMNS: tuple[Column, ...] = (
    Column.labels("file", required=False), Column("line"), Column.labels("kind"),
    Column.labels("specimen"), Column("mass", "g"), Column("voltage", "kV"), Column("elapsed", "s"),
    Column.labels("run", required=False),
    *(Column(name, required=False, absent="nan")
      for name in ("order", "read", "sigma", "baseline", "extended")),
    Column("x", "mm", required=False), Column("y", "mm", required=False))

#: The folder of coupons' diagnosis in that of actuators.
COUPONS = "coupons"

#: Causes of less than this probability are not listed.
_LEAST = 0.01

#: Share of the misfit that an effect must take away alone for its check to be worth while where
#: nothing explains it: half.
_WORTH = 0.5
#: How many such checks are told: more are no advice.
_CHECKS = 2

#: Sizes over the usual one up to which such actuators have them.
_PLAUSIBLE = 2.0
#: Factor on the noise for which the probabilities are told too.
_NOISIER = 1.5
#: Scatter about smooth curves over the stated noise from which it is worth a word.
_ROUGH = 1.4

#: Points of an outline in a plan.
_EDGE = 120


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that was found.

    ``model_error``: of the reduced model's deflections at the nominal fit and the best one, against
    finite elements on a fine mesh [m]; ``gain`` on readings held out; ``proposals`` for the next
    experiment and ``advice`` in a sentence; ``self_check``: what it makes of synthetic readings,
    None where that was not asked; ``loaded``: films of the specimens, where they were asked for;
    ``coupons``: the diagnosis of coupons of the same films, None where there are none or nothing
    else.
    """

    dataset: Dataset
    readings: PreparedReadings
    judgement: Judgement
    model_error: float
    gain: GainReport
    proposals: tuple[Proposal, ...]
    advice: str
    self_check: Json | None = None
    loaded: tuple[LoadedFilm, ...] = ()
    coupons: Diagnosis | None = None

    @classmethod
    def of(cls, dataset: Dataset, readings: PreparedReadings, judgement: Judgement,
           model_error: float = 0.0, seed: int = 0) -> Diagnosis:
        """With all that follows from a judgement of the dataset's readings."""
        causes, films = readings.causes, judgement.of_actuators()
        simulation = films.simulation
        # Nothing more is proposed beside coupons than the checks of what is found.
        # What is to be solved takes its time, and is for causes that cannot be told apart.
        menu: tuple[AnyExperiment, ...] = MENU
        if _verdict(judgement, readings) == "ambiguous" and all(
                isinstance(specimen, Specimen) for specimen in simulation.setup.specimens):
            menu = (*MENU, *SOLVED)
        proposals: tuple[tuple[Proposal, ...], str] = ((), "")
        if simulation.coupons_alone is None:
            proposals = propose(simulation, films, causes, menu, dataset.effort)
        return cls(dataset, readings, judgement, model_error,
                   gain_of(simulation, films.table, causes, films, seed), *proposals)

    @property
    def verdict(self) -> str:
        """The verdict; with a noise that is only assumed no cause is named."""
        return _verdict(self.judgement, self.readings)

    @property
    def chosen(self) -> Fit | None:
        """The hypothesis the extended model has, None when nothing is wrong."""
        return self.judgement.chosen

    @cached_property
    def single_effects(self) -> list[Fit]:
        """Every effect fitted alone, the one that explains most first; none if nothing is wrong."""
        return sorted(self.judgement.alone, key=lambda fit: -self.judgement.explained(fit))

    @cached_property
    def films(self) -> Judgement:
        """The judgement's part on readings of actuators, where there are some."""
        return self.judgement.of_actuators()

    @property
    def simulation(self) -> Simulation:
        """The dataset's simulation, as far as effects were explored."""
        return self.films.simulation

    @property
    def bench(self) -> Bench:
        """What makes synthetic readings like these."""
        return Bench(self.simulation, self.films.nominal.unknowns, self.films.table,
                     self.readings.causes, self.readings.stated)

    @property
    def extended(self) -> Setup | None:
        """Specimens and rig with stiffness, permittivity and effects as found."""
        if self.chosen is None:
            return None
        return self.simulation.extended(self.chosen.hypothesis, self.chosen.unknowns)

    def with_films(self) -> Diagnosis:
        """With the specimens' films, which are solved by finite elements."""
        return replace(self, loaded=tuple(loaded_films(self.films, self.extended)))

    def json(self) -> Json:
        """The JSON object that the command prints, and what else the report shows."""
        judged, posterior, chosen = self.judgement, self.judgement.posterior, self.chosen
        unit = judged.table.unit.name
        causes = [] if posterior is None else self._causes(posterior)
        place = "nowhere: what is left is noise" if self.verdict == "nothing" else where(judged)
        suspects = [] if self.verdict != "ambiguous" else suspects_among(causes)
        named = [cause for cause in causes if self.verdict == "named" and cause["named"]]
        factors = {name: np.exp(interval(judged.nominal, number)).tolist()
                   for number, name in enumerate(("stiffness_factor", "permittivity_factor"))}
        return {
            "dataset": self.dataset.name,
            "verdict": self.verdict,
            "headline": headline(self.verdict, named, suspects, place, judged.small_errors),
            "causes": causes,
            "together": together(suspects),
            "indistinguishable": [sorted({cause.name for cause in group})
                                  for group in judged.indistinguishable],
            "misfit": self._misfit(place),
            "predictive": self.gain.predictive,
            "gain": self.gain.json(),
            "next_experiment": self._next_experiment([*named, *suspects]),
            "not_visible": sorted({cause.name for cause in judged.invisible}),
            "probability": {"nothing": 1.0 if posterior is None else posterior.nothing,
                            "unknown": 0.0 if posterior is None else posterior.discrepancy},
            "attempts": [self._attempt(fit) for fit in self.single_effects],
            "after": chosen and {f"rmse_{unit}": self._rmse(self.films.chosen),
                                 "p_value": judged.after and judged.after.p_value,
                                 "effects": [str(cause) for cause in chosen.hypothesis]},
            "baseline": {name: dict(zip(("value", "low", "high"), values, strict=True))
                         for name, values in factors.items()},
            "noisier": {"factor": _NOISIER, "probability": self._with_more_noise()},
            "small_errors": judged.small_errors,
            "robust": [{"factor": factor, "stand_out": sorted(map(str, causes))}
                       for factor, causes in sorted(judged.robust.items())],
            f"model_error_{unit}": judged.table.unit.per_si * self.model_error,
            "knowable": detectable_effects(judged.signatures),
            "self_check": self.self_check,
            "warnings": self._limitations(),
            "films": self._plans() if judged.table.scans else {},
            "loaded_films": [{"specimen": film.specimen, "mass_kg": film.mass,
                              "voltage_V": film.voltage} for film in self.loaded],
            **({"coupons": self.coupons.json()} if self.coupons else {}),
            **({"coupon_reading": self.dataset.coupon_reading}
               if self.simulation.coupons_alone else {}),
        }

    def _attempt(self, fit: Fit) -> Json:
        """An effect fitted alone."""
        cause = fit.hypothesis[0]
        widths = fit.surprise(cause)
        return {"effect": cause.name, "which": cause.which,
                "explains": self.judgement.explained(fit), "parameters": _parameters(fit, cause),
                "headline": told(fit, cause)["headline"], "prior_widths": widths,
                "plausible": widths <= _PLAUSIBLE, "at_limit": fit.at_limit}

    def _rmse(self, fit: Fit | None) -> float:
        """Root mean square of what a fit of the films misses, as it was read."""
        table, tests = self.films.table, self.simulation.coupons_alone
        errors = (fit or self.films.nominal).residual * table.sigma
        return _root(errors if tests is None else tests.as_read(errors), table)

    def _plans(self) -> Json:
        """Plans of the films that were scanned, by specimen, in the places' frame [mm]."""
        table, plans = self.films.table, {}
        centred = self.dataset.field_frame == "plate"
        for number in np.unique(table.specimen[table.point >= 0]):
            specimen = self.simulation.setup.specimens[number]
            origin = np.array(specimen.plate.offset if centred else (0.0, 0.0))
            plans[specimen.name] = {
                name: (1e3 * (outline.points(_EDGE).T - origin)).tolist()
                for name, outline in (("frame", specimen.frame), ("plate", specimen.plate))}
        return plans

    def save(self, folder: Path) -> None:
        """Write the readings, the extended model and, last, diagnosis.json to a folder.

        Those of coupons of the same films to a folder in it.
        """
        if self.coupons is not None:
            self.coupons.save(folder / COUPONS)
        if self.simulation.coupons_alone is None:
            self._save_readings(folder)
            specimens = self.extended.specimens if self.extended else ()
        else:
            save_coupons(folder, self.simulation.coupons_alone, self.judgement, self.chosen)
            specimens = self._at_temperatures()
        setup = self.extended
        if setup is not None:
            write_text(folder / "extended" / "rig.toml", rig_to_toml(setup.rig))
        for specimen in specimens:
            try:
                suffix, text = "toml", specimen_to_toml(specimen)
            except InputError as error:
                suffix, text = "txt", f"{error}\n"
            write_text(folder / "extended" / f"{specimen.name}.{suffix}", text)
        write_json(folder / "diagnosis.json", self.json())

    def _save_readings(self, folder: Path) -> None:
        table, nominal, chosen = self.films.table, self.films.nominal, self.films.chosen
        specimens = np.array([specimen.name for specimen in self.simulation.setup.specimens])
        write_sheet(folder / "readings.csv", COLUMNS, {
            "file": table.file, "line": table.line, "kind": table.kind,
            "specimen": specimens[table.specimen], "mass": table.mass, "voltage": table.voltage,
            "elapsed": table.states.elapsed[table.state], "run": table.run, "order": table.order,
            "read": table.value, "sigma": table.sigma,
            "baseline": nominal.predicted(table), "extended": (chosen or nominal).predicted(table),
            **dict(zip("xy", table.places.T, strict=True))})
        write_sheet(folder / "curves.csv", CURVES,
                    curves(self.simulation, self.films, chosen))
        for film in self.loaded:
            film.film.save(folder / "films" / f"{film.specimen}.vtu")

    def _at_temperatures(self) -> tuple[Specimen, ...]:
        """The extended specimens of coupons, and as they are at the temperatures of the tests."""
        setup, tests = self.extended, self.simulation.coupons_alone
        if setup is None or tests is None:
            return ()
        warm = [at_temperature(specimen, celsius) for specimen in setup.specimens
                if specimen.membrane.temperature_power
                for celsius in np.unique(tests.coupons.degrees).tolist()]
        return (*setup.specimens, *warm)

    def _causes(self, posterior: Posterior) -> list[Json]:
        judged, probabilities = self.judgement, posterior.of_causes()
        rivals = {fit.hypothesis[0]: fit for fit in judged.rivals}
        causes = dict.fromkeys([*probabilities, *rivals])
        listed = []
        for cause in causes:
            probability = probabilities.get(cause, 0.0)
            if probability < _LEAST and cause not in judged.suspects:
                continue
            fit = rivals.get(cause) or next(
                fit for fit in (self.chosen, *posterior.fits, *judged.alone)
                if fit and cause in fit.hypothesis)
            listed.append({"effect": cause.name, "which": cause.which, "probability": probability,
                           **told(fit, cause, probability), "only_its_size": cause in rivals,
                           "with": [str(other) for other in fit.hypothesis if other != cause],
                           "named": cause in judged.named, "parameters": _parameters(fit, cause)})
        return listed

    def _with_more_noise(self) -> float | None:
        """About how probable what is named would be with a larger noise; None without any.

        Nor where small errors have been added to it already.
        """
        posterior, nominal = self.judgement.posterior, self.judgement.nominal
        if posterior is None or self.verdict != "named" or self.judgement.small_errors:
            return None
        fits = (nominal, *posterior.fits)
        # Misfits weigh less, and what they leave of the unknowns grows.
        change = np.array([0.5 * (1 - _NOISIER**-2.0) * fit.chi_squared
                           + len(fit.unknowns) * np.log(_NOISIER) for fit in fits])
        named = [set(self.judgement.named) <= set(fit.hypothesis) for fit in fits]
        # What else there may be counts as it does beside the best hypothesis.
        shares = np.array([posterior.nothing, *posterior.probabilities, posterior.discrepancy])
        with np.errstate(divide="ignore"):
            logs = np.log(shares)
        # A share too small for a number is as far behind as its evidence is.
        behind = np.array([fit.evidence - posterior.fits[0].evidence for fit in fits] + [0.0])
        logs = np.where(shares > 0, logs, behind) + np.array([*change, change[1]])
        weight = np.exp(logs - logs.max())
        return float(weight[:-1][named].sum() / weight.sum())

    def _misfit(self, place: str) -> Json:
        judged, table, nominal = self.judgement, self.films.table, self.films.nominal
        unit = table.unit.name
        names = [specimen.name for specimen in self.simulation.setup.specimens]
        predicted = nominal.predicted(table)
        p_values = sorted(judged.test.p_values.items(), key=lambda item: item[1])
        return {
            f"baseline_rmse_{unit}": self._rmse(None),
            f"noise_{unit}": _root(table.sigma, table),
            "noise_from": self.readings.noise_from,
            "noise_over_stated": judged.noise_over(self.readings.table),
            "p_value": judged.test.p_value,
            "where": place,
            "ratios": ratios(table, predicted, names) if table.lengths.any() else [],
            "patterns": [{"what": judged.test.words(name), "p_value": p} for name, p in p_values
                         if name in judged.patterns],
        }

    def _next_experiment(self, concerned: list[Json]) -> Json | None:
        """The direct checks of what is concerned, then the best experiment; None if all is well."""
        if self.verdict == "nothing":
            return None
        advice = self.advice if self.proposals else ""
        checks = [cause["check"] for cause in concerned]
        if self.verdict == "unexplained":
            worth = [fit for fit in self.single_effects
                     if self.judgement.explained(fit) >= _WORTH][:_CHECKS]
            advice = WORDS["again"]
            checks = [told(fit, fit.hypothesis[0])["check"] for fit in worth]
        if words := slip(self.films):
            look_up = WORDS["look_up"].format(slip=words)
            checks = [look_up] if self.verdict == "unexplained" else [look_up, *checks]
        step = {"what": next_step(self.verdict, checks, advice),
                "checks": list(dict.fromkeys(checks)), "after_checks": advice}
        if self.verdict == "unexplained" or not self.proposals:
            return {**step, "separates": [], "expected_chi_squared": None, "menu": []}
        menu = [{"what": proposal.what, "separates": list(proposal.separates),
                 "expected_chi_squared": proposal.expected, "enough": proposal.enough,
                 "minutes": proposal.minutes}
                for proposal in self.proposals]
        best = next((entry for entry in menu if entry["enough"]), menu[0])
        return {**step, "separates": best["separates"],
                "expected_chi_squared": best["expected_chi_squared"], "menu": menu}

    def _limitations(self) -> list[str]:
        """What limits the conclusions."""
        words = [*dataset_warnings(self.dataset), *self.readings.remarks]
        noise = float(np.median(self.films.table.sigma))
        scatter = self.judgement.noise_over(self.readings.table)
        if self.readings.assumed:
            words.append(WORDS["assumed"])
        if self.model_error > 0.5 * noise:
            words.append(WORDS["reduced"].format(error=1e6 * self.model_error, noise=1e6 * noise))
        if scatter > _ROUGH and self.readings.stated:
            words.append(WORDS["scatters"].format(scatter=scatter))
        return words


def _verdict(judgement: Judgement, readings: PreparedReadings) -> str:
    verdict = judgement.verdict
    return "ambiguous" if verdict == "named" and readings.assumed else verdict


def load_diagnosis(folder: Path) -> tuple[Json, dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """What :meth:`Diagnosis.save` wrote: the JSON object, readings.csv and curves.csv [SI].

    Of coupons strips.csv and no curves.

    An :class:`InputError` for what an older version has written.
    """
    content = read_json(folder / "diagnosis.json")
    if "headline" not in content:
        raise InputError("is of an older version: run tympan diagnose again",
                         file=folder / "diagnosis.json")
    if (folder / COUPON_FILE).exists():
        return content, read_own_sheet(folder / COUPON_FILE, COUPON_COLUMNS), {}
    return (content, read_own_sheet(folder / "readings.csv", COLUMNS),
            read_own_sheet(folder / "curves.csv", CURVES))


def _root(errors: Array, table: ReadingTable) -> float:
    """Root mean square of a table's errors, of those that count, in its unit."""
    return table.unit.per_si * float(np.sqrt(np.mean(errors[table.judged] ** 2)))


def _parameters(fit: Fit, cause: Cause) -> Json:
    """The parameters of a cause at a fit, in the units to show, with 95 % limits; inf is None."""
    parameters: Json = {}
    for name, size in found_sizes(fit, cause).items():
        shown = (size.parameter.shown(value) for value in (size.value, size.low, size.high))
        value, low, high = (item if np.isfinite(item) else None for item in shown)
        parameters[name] = {"value": value, "unit": size.parameter.unit, "low": low,
                            "high": high,
                            "words": "" if size.range else f"{size}"}
    return parameters
