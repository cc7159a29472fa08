"""Conclusions of a judgement: causes, misfit, gain, next experiment, as a result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array, Columns
from tympan.base.errors import InputError
from tympan.fem.toml_writer import rig_to_toml, specimen_to_toml
from tympan.geometry.specimen import Specimen
from tympan.studies.data.checks import dataset_warnings, findings
from tympan.studies.data.dataset import Dataset
from tympan.studies.data.findings import Finding
from tympan.studies.data.noise import stated_noise
from tympan.studies.diagnosis import result
from tympan.studies.diagnosis.evidence.kind import PreparedReadings, ReadingModel
from tympan.studies.diagnosis.explanations.kind import Explanation, Written
from tympan.studies.diagnosis.explanations.registry import explanation_of
from tympan.studies.diagnosis.fits.evidence import interval
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.gain import GainReport, gain_of
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.families import (
    family_size,
    found_sizes,
    has_size,
    one_load_instead,
    undecided,
)
from tympan.studies.diagnosis.inference.identifiability import detectable_effects
from tympan.studies.diagnosis.inference.noise_terms import LOUDER, probability_off
from tympan.studies.diagnosis.inference.posterior import Posterior
from tympan.studies.diagnosis.inference.ratios import ratios
from tympan.studies.diagnosis.inference.verdict import Judgement, probability_with_noise
from tympan.studies.diagnosis.next_experiment.experiments import MENU
from tympan.studies.diagnosis.next_experiment.proposals import AnyExperiment, Proposal, propose
from tympan.studies.diagnosis.next_experiment.solved_experiments import SOLVED
from tympan.studies.diagnosis.reading_table import UNITS
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.result import Diagnosis, Json, Verdict
from tympan.studies.diagnosis.self_check import Bench
from tympan.studies.diagnosis.sentences import (
    WORDS,
    check_of,
    headline,
    headline_of,
    members_of_one,
    next_step,
    pattern_checks,
    probability_text,
    suspects_among,
    where,
    with_other_loads,
)
from tympan.studies.diagnosis.shown.curves import OTHERS, curves, driven_names
from tympan.studies.diagnosis.shown.loaded_films import loaded_films
from tympan.studies.effects import Setup
from tympan.studies.effects.findings import FoundSize, family_finding

#: Least probability of a cause that is listed.
_LEAST = 0.01

#: Share of the misfit that an effect must remove alone, half, before its check is recommended where
#: no hypothesis explains the misfit.
_WORTH = 0.5
#: Most checks of effects that are recommended: more would be no advice.
_CHECKS = 2

#: Sizes over the prior scale up to which such actuators show an effect.
_PLAUSIBLE = 2.0
#: Factor on the noise for which the probabilities are given too.
_NOISIER = 1.5
#: Ratio of the scatter about smooth curves to the stated noise from which it is mentioned.
_ROUGH = 1.4

#: Points of an outline in a plan.
_EDGE = 120


@dataclass(frozen=True, eq=False)
class Conclusions:
    """A judgement of a dataset's readings, with the conclusions drawn from it.

    ``model_error``: error of the reduced model's deflections at the nominal and the best fit,
    against finite elements on a fine mesh [m]; ``gain``: on held-out readings; ``proposals``: for
    the next experiment, and ``advice``: the same in a sentence; ``explanation``: of a misfit by a
    fault of the data alone; ``coupons``: the conclusions from coupons of the same films, None where
    there are no coupons or nothing else.
    """

    dataset: Dataset
    readings: PreparedReadings
    judgement: Judgement
    model_error: float
    gain: GainReport
    proposals: tuple[Proposal, ...]
    advice: str
    explanation: Explanation | None = None
    coupons: Conclusions | None = None

    @classmethod
    def of(cls, dataset: Dataset, readings: PreparedReadings, judgement: Judgement,
           model_error: float = 0.0, seed: int = 0) -> Conclusions:
        """Draw all conclusions from a judgement of the dataset's readings."""
        causes, films = readings.causes, judgement.of_first()
        simulation = films.simulation
        # With coupons, only checks of the causes found are proposed.
        # Experiments that must be solved take time; they serve causes that are indistinguishable.
        menu: tuple[AnyExperiment, ...] = MENU
        if _verdict(judgement, readings) == "ambiguous" and all(
                isinstance(specimen, Specimen) for specimen in simulation.setup.specimens):
            menu = (*MENU, *SOLVED)
        proposals: tuple[tuple[Proposal, ...], str] = ((), "")
        if simulation.loaded:
            assert isinstance(simulation, Simulation)
            proposals = propose(simulation, films, causes, menu, dataset.effort)
        return cls(dataset, readings, judgement, model_error,
                   gain_of(simulation, films.table, causes, films, seed), *proposals,
                   explanation_of(judgement, Written(dataset, readings)))

    @property
    def verdict(self) -> Verdict:
        """The verdict; no cause is named if the noise is only assumed."""
        return _verdict(self.judgement, self.readings)

    @property
    def chosen(self) -> Fit | None:
        """The hypothesis of the extended model, None when nothing is wrong or none is better.

        Where no hypothesis explains the readings, one that misses held-out readings by no less
        than the nominal model does not count.
        """
        return self.judgement.chosen if self.gain.extends else None

    def _known(self, fit: Fit) -> Fit:
        """Widen a fit for the limits of its sizes by the misfit, where nothing explains that."""
        return fit.louder(self._widened(fit))

    @cached_property
    def single_effects(self) -> list[Fit]:
        """Every effect fitted alone, best explanation first; empty if nothing is wrong."""
        return sorted(self.judgement.weighed.alone, key=lambda fit: -self.judgement.explained(fit))

    @cached_property
    def films(self) -> Judgement:
        """The part of the judgement on readings of actuators, where there are some."""
        return self.judgement.of_first()

    @property
    def _of_films(self) -> Fit | None:
        """The part of the chosen fit on readings of actuators."""
        return self.films.chosen if self.gain.extends else None

    @property
    def simulation(self) -> ReadingModel:
        """The dataset's simulation, over the range in which effects were explored."""
        return self.films.simulation

    @property
    def bench(self) -> Bench:
        """Generator of synthetic readings like these."""
        table = self.films.table
        noise = self.readings.table.noise.with_own(table.sigma)
        return Bench(self.simulation, self.films.nominal.unknowns, table.with_noise(noise),
                     self.readings.causes)

    @property
    def extended(self) -> Setup | None:
        """Specimens and rig with stiffness, permittivity and effects as found."""
        if self.chosen is None:
            return None
        return self.simulation.extended(self.chosen.hypothesis, self.chosen.unknowns)

    def diagnosis(self, films: bool = False, self_check: Json | None = None) -> Diagnosis:
        """Assemble the result; ``films`` adds the films' shapes, solved by finite elements.

        ``self_check``: conclusions from synthetic readings, None where no self-check was asked for.
        """
        judged, posterior, chosen = self.judgement, self.judgement.posterior, self.chosen
        nominal = self._known(judged.nominal)
        unit = judged.table.unit
        causes = () if posterior is None else tuple(self._causes(posterior))
        found = self._fault
        suspects = [] if self.verdict != "ambiguous" else suspects_among(causes)
        named = [cause for cause in causes if self.verdict == "named" and cause.named]
        misfit = self._misfit()
        cannot_tell = self._cannot_tell(misfit)
        return Diagnosis(
            dataset=self.dataset.name,
            verdict=self.verdict,
            headline=headline(self.verdict, named, suspects, misfit.where,
                              judged.weighed.small_errors, found is not None, cannot_tell),
            cannot_tell=cannot_tell,
            causes=causes,
            # The fits say more about outliers (readings_off).
            findings=(*(one for one in findings(self.dataset) if one.kind != "outlier"),
                      *filter(None, [found])),
            together=members_of_one(suspects),
            indistinguishable=tuple(tuple(sorted({cause.name for cause in group}))
                                    for group in judged.misfit.indistinguishable),
            misfit=misfit,
            readings_off=tuple(self._readings_off()),
            predictive=self.gain.predictive,
            gain=self.gain.overall,
            next_experiment=self._next_experiment([*named, *suspects]),
            not_visible=tuple(sorted({cause.name for cause in judged.misfit.invisible})),
            probability=result.NoEffect(1.0, 0.0) if posterior is None else result.NoEffect(
                posterior.nothing, posterior.discrepancy),
            attempts=tuple(self._attempt(fit) for fit in self.single_effects),
            after=None if chosen is None else result.After(
                rmse=self._rmse(self._of_films),
                p_value=None if judged.weighed.after is None else judged.weighed.after.p_value,
                effects=tuple(map(str, chosen.hypothesis))),
            baseline={name: result.Factor(*np.exp(interval(nominal, number)).tolist())
                      for number, name in enumerate(("stiffness_factor", "permittivity_factor"))},
            noisier=result.Noisier(_NOISIER, probability_with_noise(
                judged, _NOISIER) if self.verdict == "named" else None),
            small_errors=judged.weighed.small_errors,
            robust=tuple(result.Robust(factor, tuple(sorted(map(str, causes))),
                                       judged.weighed.unknown.get(factor))
                         for factor, causes in sorted(judged.weighed.robust.items())),
            model_error=unit.per_si * self.model_error,
            knowable=tuple(detectable_effects(judged.misfit.signatures)),
            self_check=self_check,
            hum=tuple(hum for run in self.dataset.runs for hum in run.hum),
            late_runs=tuple(late for run in self.dataset.runs for late in run.late),
            warnings=tuple(self._limitations()),
            films=self._plans() if judged.table.scans else {},
            loaded_films=tuple(loaded_films(self.films, self.extended)) if films else (),
            coupon_reading=None if self.simulation.loaded else self.dataset.coupon_reading,
            unit=unit.name,
            tables=dict(self._tables()),
            extended=self._extended_files(),
            coupons=None if self.coupons is None else self.coupons.diagnosis())

    def _widened(self, fit: Fit) -> float:
        return fit.misfit if self.verdict == "unexplained" else 1.0

    def _attempt(self, fit: Fit) -> result.Attempt:
        """Summarise an effect fitted alone."""
        cause, known = fit.hypothesis[0], self._known(fit)
        widths = fit.surprise(cause)
        return result.Attempt(
            effect=cause.name, which=cause.which, explains=self.judgement.explained(fit),
            parameters=_parameters(known, cause), headline=headline_of(known, cause),
            widened=self._widened(fit), prior_widths=widths, plausible=widths <= _PLAUSIBLE,
            at_limit=fit.at_limit)

    def _rmse(self, fit: Fit | None) -> float:
        """Compute the root mean square misfit of the films' readings, as they were read."""
        table = self.films.table
        missed = table.value - (fit or self.films.nominal).predicted(table)
        # A zero that moved between runs is no misfit.
        return self._root(table.noise.apart(missed) if table.lengths.any() else missed)

    def _root(self, errors: Array) -> float:
        """Compute the root mean square of errors of the films' counted readings, in their unit."""
        table = self.films.table
        counts = table.judged & (table.noise.off == 0)
        return table.unit.per_si * float(np.sqrt(np.mean(errors[counts] ** 2)))

    def _readings_off(self) -> Iterator[result.ReadingOff]:
        """List readings that are outliers: their values, and those predicted from the others."""
        films = self.films
        table, sigma = films.table, films.table.sigma
        specimens = [specimen.name for specimen in self.simulation.setup.specimens]
        expected = (films.chosen or films.nominal).predicted(table)
        off = table.noise.off
        for row in np.flatnonzero(off).tolist():
            unit = UNITS[str(table.kind[row])]
            alike = (table.kind == table.kind[row]) & (off == 0)
            noise = float(np.median(sigma[alike])) if alike.any() else float(sigma[row])
            missed = float(table.value[row] - expected[row])
            yield result.ReadingOff(
                file=str(table.file[row]), line=int(table.line[row]), kind=str(table.kind[row]),
                specimen=specimens[table.specimen[row]], unit=unit.name,
                read=unit.per_si * float(table.value[row]),
                expected=unit.per_si * float(expected[row]),
                probability=float(probability_off(np.array(missed / noise))))

    def _plans(self) -> Json:
        """Give the plan views of the scanned films by specimen, in the places' frame [mm]."""
        table, plans = self.films.table, {}
        centred = self.dataset.field_frame == "plate"
        for number in np.unique(table.specimen[table.point >= 0]):
            specimen = self.simulation.setup.specimens[number]
            origin = np.array(specimen.plate.offset if centred else (0.0, 0.0))
            plans[specimen.name] = {
                name: (1e3 * (outline.points(_EDGE).T - origin)).tolist()
                for name, outline in (("frame", specimen.frame), ("plate", specimen.plate))}
        return plans

    def _extended_files(self) -> dict[str, str]:
        """Write rig and specimens of the extended model as files by name, or say why not."""
        setup = self.extended
        if setup is None:
            return {}
        files = {"rig.toml": rig_to_toml(setup.rig)}
        for specimen in self.simulation.evidence[0].specimens(setup):
            try:
                files[f"{specimen.name}.toml"] = specimen_to_toml(specimen)
            except InputError as error:
                files[f"{specimen.name}.txt"] = f"{error}\n"
        return files

    def _tables(self) -> Iterator[tuple[str, Columns]]:
        """Tabulate the readings and both models' predictions, for actuators on fine curves too."""
        table, nominal, chosen = self.films.table, self.films.nominal, self._of_films
        specimens = np.array([specimen.name for specimen in self.simulation.setup.specimens])
        # Lengths as they were read: errors that several share are counted with the models.
        common = np.where(table.lengths, table.value - table.noise.apart(table.value), 0.0)
        models = {"baseline": nominal.predicted(table),
                  "extended": (chosen or nominal).predicted(table)}
        own = self.simulation.evidence[0].written(table, specimens.tolist(), models)
        if own is not None:
            yield result.STRIPS, own
            return
        yield result.READINGS, {
            "file": table.file, "line": table.line, "kind": table.kind,
            "specimen": driven_names(self.simulation.setup, table), "mass": table.mass,
            "voltage": table.voltage,
            "elapsed": table.states.elapsed[table.state], "run": table.run, "order": table.order,
            "sigma": table.noise.own,
            "counts": (table.noise.off == 0).astype(float),
            **{name: common + table.noise.apart(values)
               for name, values in {"read": table.value, **models}.items()},
            **dict(zip("xy", table.places.T, strict=True)),
            "displacement": table.states.deflection[table.state]}
        yield result.CURVES, curves(self.simulation, self.films, chosen)
        if len((others := curves(self.simulation, self.films, chosen, OTHERS))["kind"]):
            yield result.CHANNELS, others

    def _causes(self, posterior: Posterior) -> Iterator[result.FoundCause]:
        judged, probabilities = self.judgement, posterior.of_causes()
        in_library = posterior.in_library()
        rivals = {fit.hypothesis[0]: fit for fit in judged.weighed.rivals}
        for cause in dict.fromkeys([*probabilities, *rivals]):
            probability = probabilities.get(cause, 0.0)
            if probability < _LEAST and cause not in judged.weighed.suspects:
                continue
            fit = self._found(cause)
            widened, fit = self._widened(fit), self._known(fit)
            alike = undecided(cause, self.readings.observables, self._suspects)
            family = self._family(alike, fit, cause) if alike else None
            chance = probability_text(min(1.0, sum(
                probabilities.get(other, 0.0) for other in alike or (cause,))))
            yield result.FoundCause(
                effect=cause.name, which=cause.which, again=cause.again, probability=probability,
                headline=(f"{family.headline} ({chance})" if family else with_other_loads(
                    headline_of(fit, cause, chance), self._loads_instead(fit, cause))),
                in_library=in_library.get(cause, 0.0), clear=has_size(fit, cause),
                check=check_of(cause, self.readings.observables, self._suspects), family=family,
                surprise=fit.surprise(cause), only_its_size=cause in rivals,
                others=tuple(str(other) for other in fit.hypothesis if other != cause),
                named=cause in judged.named, parameters=_parameters(fit, cause), widened=widened)

    @property
    def _suspects(self) -> tuple[Cause, ...]:
        """Causes between which the readings do not decide."""
        return self.judgement.weighed.suspects if self.verdict == "ambiguous" else ()

    def _found(self, cause: Cause) -> Fit:
        """Find the fit that determines a cause's size."""
        judged, posterior = self.judgement, self.judgement.posterior
        assert posterior is not None
        rivals = (rival for rival in judged.weighed.rivals if rival.hypothesis[0] == cause)
        fits = (*rivals, judged.chosen, *posterior.fits, *judged.weighed.alone)
        return next(fit for fit in fits if fit and cause in fit.hypothesis)

    def _family(self, alike: Sequence[Cause], fit: Fit, cause: Cause) -> result.FoundFamily:
        """Describe the family of a cause at a fit, where readings cannot separate its members."""
        family = cause.effect.family
        assert family is not None
        size = family_size(self.judgement.simulation,
                           {other: self._known(self._found(other)) for other in alike})
        return result.FoundFamily(
            name=family.name, headline=family_finding(family, size, cause.which), size=_shown(size),
            members=tuple(effect.name for effect in family.members), member=headline_of(fit, cause))

    def _loads_instead(self, fit: Fit, cause: Cause) -> dict[float, tuple[float, float]]:
        return one_load_instead(fit, cause, self.films.table, self.simulation.setup.rig)

    @property
    def _fault(self) -> Finding | None:
        """Fault in the dataset that explains the misfit, if there is one."""
        return None if self.explanation is None else self.explanation.finding

    @property
    def _place(self) -> str:
        """Sentence on where the misfit is: what explains it, or its patterns."""
        if self.verdict == "nothing":
            return "nowhere: what is left is noise"
        return where(self.judgement) if self.explanation is None else self.explanation.what

    def _misfit(self) -> result.Misfit:
        judged, table, nominal = self.judgement, self.films.table, self.films.nominal
        names = [specimen.name for specimen in self.simulation.setup.specimens]
        predicted = nominal.predicted(table)
        p_values = sorted(judged.test.p_values.items(), key=lambda item: item[1])
        return result.Misfit(
            baseline_rmse=self._rmse(None),
            noise=self._root(np.where(table.lengths, table.noise.total, table.sigma)),
            noise_from=self.readings.table.noise.source,
            noise_stated=self._noise_stated(),
            noise_over_stated=judged.noise_over(self.readings.table),
            p_value=judged.test.p_value,
            p_value_of_all=None if judged.test_of_all is None else judged.test_of_all.p_value,
            correlation=judged.table.noise.correlation,
            counts_below=(table.unit.per_si * judged.sensor.size / LOUDER if judged.sensor.size
                          else None),
            where=self._place,
            ratios=tuple(ratios(table, predicted, names)) if table.lengths.any() else (),
            patterns=tuple(result.PatternTest(judged.test.words(name), p) for name, p in p_values
                           if name in judged.misfit.patterns),
            others=tuple(self._misfits_of_other_kinds(table.value - predicted)))

    def _misfits_of_other_kinds(self, missed: Array) -> Iterator[result.MisfitOfKind]:
        """List the misfits of readings outside the first kind, kind by kind."""
        table, off = self.films.table, self.films.table.noise.off
        for kind, rows in table.rows_of.items():
            some = rows[~table.judged[rows] & (off[rows] == 0) & np.isfinite(missed[rows])]
            if len(some):
                unit = UNITS[kind]
                errors = unit.per_si * np.stack([table.sigma[some], missed[some]])
                noise, rmse = np.sqrt(np.mean(errors**2, axis=1)).tolist()
                yield result.MisfitOfKind(kind=kind, unit=unit.name, readings=len(some),
                                          noise=noise, baseline_rmse=rmse)

    def _noise_stated(self) -> float | None:
        """Find the noise of one reading as the files state it, in its unit; None if not stated."""
        unit = self.films.table.unit
        if self.simulation.loaded:
            stated = stated_noise(self.dataset)
            return None if stated is None else unit.per_si * stated
        coupons = self.dataset.coupons
        # The noise of a drop under voltage is that of two readings.
        if coupons is None or coupons.sigma is None or self.dataset.coupon_reading == "drop":
            return None
        known = coupons.sigma[np.isfinite(coupons.sigma)]
        return unit.per_si * float(np.sqrt(np.mean(known**2))) if len(known) else None

    def _cannot_tell(self, misfit: result.Misfit) -> str:
        """Say why it is not known whether the simulation agrees; "" where it is known."""
        if self.judgement.sensor.possible:
            return WORDS["wanders"].format(misfit=misfit,
                                           unit=self.judgement.table.unit.name.replace("u", "µ"))
        if self.verdict != "nothing" or not (rough := self.judgement.misfit.rough):
            return ""
        kind = max(rough, key=lambda name: rough[name])
        return WORDS["too_rough"].format(kind=kind, scatter=rough[kind])

    def _next_experiment(self, concerned: Sequence[result.FoundCause]
                         ) -> result.NextExperiment | None:
        """Choose the direct checks of these causes and the best experiment; None if all is well."""
        if self.verdict == "nothing":
            return result.NextExperiment(
                what=WORDS["do_rough"], checks=(WORDS["do_rough"],), after_checks=""
            ) if self.judgement.misfit.rough else None
        advice = self.advice if self.proposals else ""
        checks, unexplained = [cause.check for cause in concerned], self.verdict == "unexplained"
        explanation, fault = self.explanation, self._fault if unexplained else None
        if unexplained:
            advice = WORDS["again" if fault is None else "put_right"]
            checks = self._checks_of_misfit() if explanation is None else [explanation.check]
        if explanation is not None and fault is None:
            # Where nothing explains the misfit, the headline has said this already.
            what = "" if unexplained else f": {explanation.what}"
            checks = [WORDS["look_up"].format(slip=what), *checks]
        if self.judgement.sensor.possible:
            checks = [WORDS["do_noise"], *checks]
        step = result.NextExperiment(
            what=next_step(self.verdict, checks, advice, fault is not None),
            checks=tuple(dict.fromkeys(checks)), after_checks=advice)
        if unexplained or not self.proposals:
            return step
        menu = tuple(result.ProposedExperiment(
            what=proposal.what, separates=proposal.separates,
            expected_chi_squared=proposal.expected, enough=proposal.enough,
            minutes=proposal.minutes) for proposal in self.proposals)
        best = next((entry for entry in menu if entry.enough), menu[0])
        return replace(step, separates=best.separates,
                       expected_chi_squared=best.expected_chi_squared, menu=menu)

    def _checks_of_misfit(self) -> list[str]:
        """List checks where nothing explains the misfit: of its patterns and largest effects."""
        worth = [fit for fit in self.single_effects
                 if self.judgement.explained(fit) >= _WORTH][:_CHECKS]
        return [*pattern_checks(self.films),
                *(check_of(fit.hypothesis[0], self.readings.observables) for fit in worth)]

    def _limitations(self) -> list[str]:
        """List limitations of the conclusions."""
        off = {(one.file, one.line) for one in self._readings_off()}
        # Readings that the fits name as outliers are listed elsewhere and not repeated here.
        said = {one.what for one in findings(self.dataset)
                if one.kind == "outlier" and {(one.file, line) for line in one.lines} <= off}
        words = [one for one in dict.fromkeys([*dataset_warnings(self.dataset),
                                               *self.readings.remarks]) if one not in said]
        lengths = self.films.table.sigma[self.films.table.lengths]
        noise = float(np.median(lengths)) if len(lengths) else np.inf
        scatter = self.judgement.noise_over(self.readings.table)
        if self.readings.assumed:
            words.append(WORDS["assumed"])
        if self.model_error > 0.5 * noise:
            words.append(WORDS["reduced"].format(error=1e6 * self.model_error, noise=1e6 * noise))
        if scatter > _ROUGH and self.readings.table.noise.freedom.any():
            words.append(WORDS["scatters"].format(scatter=scatter))
        words += [WORDS["quiet"].format(kind=kind, times=1 / quiet)
                  for kind, quiet in self.judgement.misfit.quiet.items()]
        return words


def _verdict(judgement: Judgement, readings: PreparedReadings) -> Verdict:
    verdict = judgement.verdict
    return "ambiguous" if verdict == "named" and readings.assumed else verdict


def _parameters(fit: Fit, cause: Cause) -> dict[str, result.ShownSize]:
    """List a cause's parameters at a fit, in units to show, with 95 % limits; inf becomes None."""
    return {name: _shown(size) for name, size in found_sizes(fit, cause).items()}


def _shown(size: FoundSize) -> result.ShownSize:
    """Convert a size to what is shown, with words where only one side of it is known."""
    numbers = (size.parameter.shown(value) for value in (size.value, size.low, size.high))
    value, low, high = (item if np.isfinite(item) else None for item in numbers)
    return result.ShownSize(value, size.parameter.unit, low, high,
                            "" if size.range else f"{size}")
