"""A diagnosis as a result: everything computed, as JSON, in a folder and read back from one."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.toml_writer import rig_to_toml, specimen_to_toml
from tympan.geometry.errors import InputError
from tympan.geometry.units import quantity
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.calibration import extended_setup
from tympan.studies.diagnosis.inference.fit import Fit
from tympan.studies.diagnosis.inference.identifiability import (
    EffectIdentifiability,
    effect_identifiability,
)
from tympan.studies.diagnosis.inference.ratios import ratios
from tympan.studies.diagnosis.inference.single_effects import SingleEffect, single_effects
from tympan.studies.diagnosis.inference.verdict import Judgement, interval
from tympan.studies.diagnosis.next_experiment.proposals import Proposals, propose
from tympan.studies.diagnosis.readings import PreparedReadings
from tympan.studies.diagnosis.reduced.hypothesis import Cause, sizes_of
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.text import AGAIN, limitations, where
from tympan.studies.diagnosis.validation.gain import LENGTHS, GainReport, SplitGain, gain_of
from tympan.studies.effects import EffectParameter, Setup
from tympan.studies.files import write_csv, write_json, write_text

Array = NDArray[np.float64]
Json = dict[str, Any]

#: Causes of less than this probability are not listed.
_LEAST = 0.01

_HEADER = ("file", "line", "kind", "specimen", "mass_g", "voltage_kV", "elapsed_s", "order", "read",
           "sigma", "baseline", "extended")
_WORDS = ("file", "kind", "specimen")


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that was found.

    ``model_error``: of the reduced model's deflections at the nominal fit and the best one, against
    finite elements on a fine mesh [m]; ``swept``: verdict and causes with the priors' widths times
    each of some factors; ``chosen``: the hypothesis the extended model has, None when nothing is
    wrong; ``gain`` on readings held out; ``proposals`` for the next experiment; ``single_effects``
    each fitted alone; ``identifiability``: what these readings can tell.
    """

    dataset: Dataset
    readings: PreparedReadings
    simulation: Simulation
    judgement: Judgement
    model_error: float
    swept: tuple[tuple[str, tuple[str, ...]], ...]
    chosen: Fit | None
    gain: GainReport
    proposals: Proposals
    single_effects: tuple[SingleEffect, ...]
    identifiability: EffectIdentifiability

    @classmethod
    def of(cls, dataset: Dataset, readings: PreparedReadings, simulation: Simulation,
           judgement: Judgement, model_error: float = 0.0,
           swept: tuple[tuple[str, tuple[str, ...]], ...] = (), seed: int = 0) -> Diagnosis:
        """With all that follows from a judgement of the dataset's readings."""
        causes = readings.causes
        nominal = judgement.nominal.unknowns
        return cls(dataset, readings, simulation, judgement, model_error, swept,
                   chosen_fit(judgement),
                   gain_of(simulation, readings.table, causes, judgement, seed),
                   propose(simulation, judgement, causes),
                   single_effects(simulation, judgement, causes),
                   effect_identifiability(simulation, judgement.table, nominal, causes))

    @property
    def verdict(self) -> str:
        """The verdict; with a noise that is only assumed no cause is named."""
        verdict = self.judgement.verdict
        return "ambiguous" if verdict == "named" and self.readings.assumed else verdict

    @property
    def extended(self) -> Setup | None:
        """Specimens and rig with stiffness, permittivity and effects as found."""
        if self.chosen is None:
            return None
        return extended_setup(self.simulation, self.chosen.hypothesis, self.chosen.unknowns)

    @property
    def moves(self) -> bool:
        """Whether the verdict or the named causes change with the priors' widths."""
        usual = self.judgement.verdict, cause_names(self.judgement.named)
        return any(verdict != usual for verdict in self.swept)

    def json(self) -> Json:
        """The JSON object that the command prints, and what else the report shows."""
        judged, posterior = self.judgement, self.judgement.posterior
        return {
            "dataset": self.dataset.name,
            "verdict": self.verdict,
            "causes": self._causes(),
            "indistinguishable": [sorted({cause.name for cause in group})
                                  for group in judged.indistinguishable],
            "misfit": self._misfit(),
            "gain": _gain(self.gain),
            "next_experiment": self._next_experiment(),
            "not_visible": sorted({cause.name for cause in judged.invisible}),
            "probability": {"nothing": 1.0 if posterior is None else posterior.nothing,
                            "unknown": 0.0 if posterior is None else posterior.discrepancy},
            "attempts": [_single_effect(effect) for effect in self.single_effects],
            "after": self._after(),
            "baseline": _factors(judged.nominal),
            "priors_swept": {"moves": self.moves,
                             "verdicts": [verdict for verdict, _ in self.swept]},
            "model_error_um": 1e6 * self.model_error,
            "knowable": [effect.json() for effect in self.identifiability.effects],
            "warnings": limitations(self.dataset, self.readings, judged, self.model_error,
                                    self.moves),
        }

    def save(self, folder: Path) -> None:
        """Write the readings, the extended model and, last, diagnosis.json to a folder."""
        write_csv(folder / "readings.csv", _HEADER, self._rows())
        for name, text in self._extended_files():
            write_text(folder / "extended" / name, text)
        write_json(folder / "diagnosis.json", self.json())

    def _causes(self) -> list[Json]:
        """The causes in question, most probable first, with their parameters."""
        posterior, listed = self.judgement.posterior, []
        for cause, probability in ({} if posterior is None else posterior.of_causes()).items():
            if posterior is None or (probability < _LEAST
                                     and cause not in self.judgement.suspects):
                continue
            fit = posterior.fit_of((cause,)) or posterior.with_cause(cause)
            if self.chosen is not None and cause in self.chosen.hypothesis:
                fit = self.chosen
            listed.append({"effect": cause.name, "which": cause.which, "probability": probability,
                           "parameters": _parameters(fit, cause)})
        return listed

    def _misfit(self) -> Json:
        """What the calibrated nominal model leaves."""
        judged, table = self.judgement, self.judgement.table
        lengths = np.isin(table.kind, LENGTHS)
        words = {pattern.name: pattern.words for pattern in judged.patterns}
        names = [specimen.name for specimen in self.simulation.setup.specimens]
        predicted = table.value - judged.nominal.residual * table.sigma
        p_values = sorted(judged.test.p_values.items(), key=lambda item: item[1])
        return {
            "baseline_rmse_um": 1e6 * _rmse(judged.nominal.residual[lengths],
                                            table.sigma[lengths]),
            "noise_um": 1e6 * float(np.sqrt(np.mean(table.sigma[lengths] ** 2))),
            "noise_from": self.readings.noise_from,
            "noise_over_stated": judged.test.noise,
            "p_value": judged.test.p_value,
            "where": (where(judged) if self.verdict != "nothing"
                      else "nowhere: what is left is noise"),
            "ratios": [{**asdict(ratio), "off_by_noise": ratio.off}
                       for ratio in ratios(table, predicted, names)],
            "patterns": [{"what": words[name], "p_value": p} for name, p in p_values
                         if name in words],
        }

    def _after(self) -> Json | None:
        """What the extended model leaves."""
        if self.chosen is None:
            return None
        table, test = self.judgement.table, self.judgement.after
        lengths = np.isin(table.kind, LENGTHS)
        return {"rmse_um": 1e6 * _rmse(self.chosen.residual[lengths], table.sigma[lengths]),
                "p_value": None if test is None else test.p_value,
                "effects": [str(cause) for cause in self.chosen.hypothesis]}

    def _next_experiment(self) -> Json | None:
        """The best experiment; None where nothing is to be told apart."""
        if self.verdict == "unexplained":
            return {"what": AGAIN, "separates": [], "expected_chi_squared": None, "menu": []}
        ranked = self.proposals.ranked
        if not ranked:
            return None
        best = next((proposal for proposal in ranked if proposal.enough), ranked[0])
        return {"what": self.proposals.sentence, "separates": list(best.effects),
                "expected_chi_squared": best.expected,
                "menu": [{"what": proposal.what, "separates": list(proposal.effects),
                          "expected_chi_squared": proposal.expected,
                          "enough": proposal.enough} for proposal in ranked]}

    def _rows(self) -> Iterator[tuple[object, ...]]:
        """The readings in SI, with what both models say."""
        table, chosen = self.judgement.table, self.chosen or self.judgement.nominal
        nominal = table.value - self.judgement.nominal.residual * table.sigma
        best = table.value - chosen.residual * table.sigma
        specimens = [specimen.name for specimen in self.simulation.setup.specimens]
        elapsed = table.states.elapsed[table.state]
        gram, kilovolt = quantity("1 g", "mass"), quantity("1 kV", "voltage")
        for row in range(len(table)):
            yield (str(table.file[row]), int(table.line[row]), str(table.kind[row]),
                   specimens[int(table.specimen[row])], float(table.mass[row] / gram),
                   float(table.voltage[row] / kilovolt), float(elapsed[row]),
                   float(table.order[row]), float(table.value[row]), float(table.sigma[row]),
                   float(nominal[row]), float(best[row]))

    def _extended_files(self) -> Iterator[tuple[str, str]]:
        """Names and texts of the extended model's files."""
        setup = self.extended
        if setup is None:
            return
        yield "rig.toml", rig_to_toml(setup.rig)
        for specimen in setup.specimens:
            try:
                yield f"{specimen.name}.toml", specimen_to_toml(specimen)
            except InputError as error:
                yield f"{specimen.name}.txt", f"{error}\n"


@dataclass(frozen=True, eq=False)
class SavedDiagnosis:
    """A diagnosis read from its folder.

    ``content`` is its JSON object; ``columns`` are those of readings.csv by name, shape (rows,)
    each, lengths in m: numbers but for file, kind and specimen.
    """

    content: Json
    columns: dict[str, NDArray[Any]]


def load(folder: Path) -> SavedDiagnosis:
    """What :meth:`Diagnosis.save` wrote.

    Raises
    ------
    InputError
        When diagnosis.json or readings.csv is missing or damaged.
    """
    try:
        content = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
        with (folder / "readings.csv").open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        columns = {name: np.array([row[name] if name in _WORDS else float(row[name])
                                   for row in rows]) for name in _HEADER}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"cannot be read: {error}; run tympan diagnose again",
                         file=folder) from None
    return SavedDiagnosis(content, columns)


def chosen_fit(judged: Judgement) -> Fit | None:
    """The hypothesis to extend the model with: the causes named, or the most probable."""
    posterior = judged.posterior
    if posterior is None:
        return None
    return (posterior.fit_of(judged.named) if judged.named else None) or posterior.best


def cause_names(causes: tuple[Cause, ...]) -> tuple[str, ...]:
    """Causes as words, in order."""
    return tuple(sorted(map(str, causes)))


def _rmse(residual: Array, sigma: Array) -> float:
    """Root mean square of residuals given over their noise [m]."""
    return float(np.sqrt(np.mean((residual * sigma) ** 2)))


def _parameters(fit: Fit, cause: Cause) -> Json:
    """The parameters of a cause at a fit, in the units to show, with 95 % limits."""
    parameters: Json = {}
    first = sizes_of(fit.hypothesis, cause).start
    for number, parameter in enumerate(cause.effect.parameters, first):
        value, *limits = (_shown(parameter, size) for size in interval(fit, number))
        low, high = sorted(limits, key=lambda limit: np.inf if limit is None else limit)
        parameters[parameter.name] = {"value": value, "unit": parameter.unit, "low": low,
                                      "high": high}
    return parameters


def _shown(parameter: EffectParameter, size: float) -> float | None:
    """A size as the value to show; None where it is infinite."""
    value = parameter.shown(parameter.value(size))
    return value if np.isfinite(value) else None


def _factors(nominal: Fit) -> Json:
    """The refitted factors on stiffness and permittivity, with 95 % limits."""
    factors = {}
    for number, name in enumerate(("stiffness_factor", "permittivity_factor")):
        value, low, high = np.exp(interval(nominal, number)).tolist()
        factors[name] = {"value": value, "low": low, "high": high}
    return factors


def _single_effect(effect: SingleEffect) -> Json:
    return {"effect": effect.cause.name, "which": effect.cause.which, "explains": effect.share,
            "parameters": _parameters(effect.fit, effect.cause), "prior_widths": effect.widths,
            "plausible": effect.plausible, "at_limit": effect.bounded}


def _gain(report: GainReport) -> Json | None:
    """The gain over all splits, and that of each."""
    if report.overall is None:
        return None
    return {**asdict(report.overall), "splits": [_split(split) for split in report.splits],
            "impossible": list(report.impossible)}


def _split(split: SplitGain) -> Json:
    errors = {key: 1e6 * value if np.isfinite(value) else None
              for key, value in split.rmse.items()}
    return {"held_out": split.split.held_out, "chosen": [str(cause) for cause in split.chosen],
            "wrong": [str(cause) for cause in split.wrong], "rmse_um": errors, "note": split.note}
