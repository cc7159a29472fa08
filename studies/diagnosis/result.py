"""A diagnosis as a result: everything computed, as JSON, in a folder and read back from one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.toml_writer import rig_to_toml, specimen_to_toml
from tympan.geometry.errors import InputError
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.data.checks import dataset_warnings
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.calibration import extended_setup
from tympan.studies.diagnosis.gain import GainReport, gain_of
from tympan.studies.diagnosis.inference.identifiability import detectable_effects
from tympan.studies.diagnosis.inference.posterior import Fit, Posterior
from tympan.studies.diagnosis.inference.ratios import ratios
from tympan.studies.diagnosis.inference.residual_tests import words_of
from tympan.studies.diagnosis.inference.verdict import (
    Judgement,
    SingleEffect,
    interval,
    single_effects,
)
from tympan.studies.diagnosis.next_experiment import Proposal, propose
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.readings import PreparedReadings
from tympan.studies.diagnosis.reduced.simulation import Cause, Simulation, sizes_of
from tympan.studies.diagnosis.self_check import Bench
from tympan.studies.effects import Setup
from tympan.studies.files import read_json, words_beside, write_json, write_text

Array = NDArray[np.float64]
Json = dict[str, Any]

#: The columns of readings.csv: what was read, and what both models say [SI].
COLUMNS: tuple[Column, ...] = (
    Column.labels("file", required=False), Column("line"), Column.labels("kind"),
    Column.labels("specimen"), Column("mass", "g"), Column("voltage", "kV"), Column("elapsed", "s"),
    *(Column(name, required=False, absent="nan")
      for name in ("order", "read", "sigma", "baseline", "extended")))

#: Causes of less than this probability are not listed.
_LEAST = 0.01
#: Patterns that noise shows less often than this are told too.
_CLEAR = 1e-3
#: Scatter about smooth curves over the stated noise from which it is worth a word.
_ROUGH = 1.4

#: Sentences, by key.
WORDS = words_beside(__file__)


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that was found.

    ``model_error``: of the reduced model's deflections at the nominal fit and the best one, against
    finite elements on a fine mesh [m]; ``swept``: verdict and causes with the priors' widths times
    each of some factors; ``chosen``: the hypothesis the extended model has, None when nothing is
    wrong; ``gain`` on readings held out; ``proposals`` for the next experiment and ``advice`` in a
    sentence; ``single_effects`` each fitted alone; ``detectable``: what these readings can tell;
    ``self_check``: what it makes of synthetic ones, None where that was not asked.
    """

    dataset: Dataset
    readings: PreparedReadings
    simulation: Simulation
    judgement: Judgement
    model_error: float
    swept: tuple[tuple[str, tuple[str, ...]], ...]
    chosen: Fit | None
    gain: GainReport
    proposals: tuple[Proposal, ...]
    advice: str
    single_effects: tuple[SingleEffect, ...]
    detectable: list[Json]
    self_check: Json | None = None

    @classmethod
    def of(cls, dataset: Dataset, readings: PreparedReadings, simulation: Simulation,
           judgement: Judgement, model_error: float = 0.0,
           swept: tuple[tuple[str, tuple[str, ...]], ...] = (), seed: int = 0) -> Diagnosis:
        """With all that follows from a judgement of the dataset's readings."""
        causes = readings.causes
        return cls(dataset, readings, simulation, judgement, model_error, swept,
                   judgement.chosen,
                   gain_of(simulation, readings.table, causes, judgement, seed),
                   *propose(simulation, judgement, causes),
                   single_effects(judgement),
                   detectable_effects(judgement.signatures))

    @property
    def verdict(self) -> str:
        """The verdict; with a noise that is only assumed no cause is named."""
        verdict = self.judgement.verdict
        return "ambiguous" if verdict == "named" and self.readings.assumed else verdict

    @property
    def bench(self) -> Bench:
        """What makes synthetic readings like these."""
        return Bench(self.simulation, self.judgement.nominal.unknowns, self.judgement.table,
                     self.readings.causes, self.readings.stated)

    @property
    def extended(self) -> Setup | None:
        """Specimens and rig with stiffness, permittivity and effects as found."""
        if self.chosen is None:
            return None
        return extended_setup(self.simulation, self.chosen.hypothesis, self.chosen.unknowns)

    def json(self) -> Json:
        """The JSON object that the command prints, and what else the report shows."""
        judged, posterior, chosen = self.judgement, self.judgement.posterior, self.chosen
        # Whether the verdict or the named causes change with the priors' widths.
        moves = any(verdict != (judged.verdict, cause_names(judged.named))
                    for verdict in self.swept)
        factors = {name: np.exp(interval(judged.nominal, number)).tolist()
                   for number, name in enumerate(("stiffness_factor", "permittivity_factor"))}
        return {
            "dataset": self.dataset.name,
            "verdict": self.verdict,
            "causes": [] if posterior is None else self._causes(posterior),
            "indistinguishable": [sorted({cause.name for cause in group})
                                  for group in judged.indistinguishable],
            "misfit": self._misfit(),
            "gain": self.gain.json(),
            "next_experiment": self._next_experiment(),
            "not_visible": sorted({cause.name for cause in judged.invisible}),
            "probability": {"nothing": 1.0 if posterior is None else posterior.nothing,
                            "unknown": 0.0 if posterior is None else posterior.discrepancy},
            "attempts": [{"effect": effect.cause.name, "which": effect.cause.which,
                          "explains": effect.share,
                          "parameters": _parameters(effect.fit, effect.cause),
                          "prior_widths": effect.widths, "plausible": effect.plausible,
                          "at_limit": effect.bounded} for effect in self.single_effects],
            "after": chosen and {"rmse_um": _rmse_um(chosen.residual, judged.table),
                                 "p_value": judged.after and judged.after.p_value,
                                 "effects": [str(cause) for cause in chosen.hypothesis]},
            "baseline": {name: dict(zip(("value", "low", "high"), values, strict=True))
                         for name, values in factors.items()},
            "priors_swept": {"moves": moves, "verdicts": [verdict for verdict, _ in self.swept]},
            "model_error_um": 1e6 * self.model_error,
            "knowable": self.detectable,
            "self_check": self.self_check,
            "warnings": self._limitations(moves),
        }

    def save(self, folder: Path) -> None:
        """Write the readings, the extended model and, last, diagnosis.json to a folder."""
        table, nominal = self.judgement.table, self.judgement.nominal
        specimens = np.array([specimen.name for specimen in self.simulation.setup.specimens])
        write_sheet(folder / "readings.csv", COLUMNS, {
            "file": table.file, "line": table.line, "kind": table.kind,
            "specimen": specimens[table.specimen], "mass": table.mass, "voltage": table.voltage,
            "elapsed": table.states.elapsed[table.state], "order": table.order,
            "read": table.value, "sigma": table.sigma,
            "baseline": table.value - nominal.residual * table.sigma,
            "extended": table.value - (self.chosen or nominal).residual * table.sigma})
        setup = self.extended
        if setup is not None:
            write_text(folder / "extended" / "rig.toml", rig_to_toml(setup.rig))
            for specimen in setup.specimens:
                try:
                    suffix, text = "toml", specimen_to_toml(specimen)
                except InputError as error:
                    suffix, text = "txt", f"{error}\n"
                write_text(folder / "extended" / f"{specimen.name}.{suffix}", text)
        write_json(folder / "diagnosis.json", self.json())

    def _causes(self, posterior: Posterior) -> list[Json]:
        listed = []
        for cause, probability in posterior.of_causes().items():
            if probability < _LEAST and cause not in self.judgement.suspects:
                continue
            fit = posterior.fit_of((cause,)) or posterior.with_cause(cause)
            if self.chosen is not None and cause in self.chosen.hypothesis:
                fit = self.chosen
            listed.append({"effect": cause.name, "which": cause.which, "probability": probability,
                           "parameters": _parameters(fit, cause)})
        return listed

    def _misfit(self) -> Json:
        judged, table = self.judgement, self.judgement.table
        names = [specimen.name for specimen in self.simulation.setup.specimens]
        predicted = table.value - judged.nominal.residual * table.sigma
        p_values = sorted(judged.test.p_values.items(), key=lambda item: item[1])
        return {
            "baseline_rmse_um": _rmse_um(judged.nominal.residual, table),
            "noise_um": _rmse_um(np.ones(len(table)), table),
            "noise_from": self.readings.noise_from,
            "noise_over_stated": judged.test.noise,
            "p_value": judged.test.p_value,
            "where": (_where(judged) if self.verdict != "nothing"
                      else "nowhere: what is left is noise"),
            "ratios": ratios(table, predicted, names),
            "patterns": [{"what": words_of(name), "p_value": p} for name, p in p_values
                         if name in judged.patterns],
        }

    def _next_experiment(self) -> Json | None:
        """The best experiment; None where nothing is to be told apart."""
        if self.verdict == "unexplained":
            return {"what": WORDS["again"], "separates": [], "expected_chi_squared": None,
                    "menu": []}
        if not self.proposals:
            return None
        menu = [{"what": proposal.what, "separates": list(proposal.separates),
                 "expected_chi_squared": proposal.expected, "enough": proposal.enough}
                for proposal in self.proposals]
        best = next((entry for entry in menu if entry["enough"]), menu[0])
        return {"what": self.advice, "separates": best["separates"],
                "expected_chi_squared": best["expected_chi_squared"], "menu": menu}

    def _limitations(self, moves: bool) -> list[str]:
        """What limits the conclusions; ``moves``: whether the verdict does so with the priors."""
        words = [*dataset_warnings(self.dataset), *self.readings.remarks]
        noise, scatter = float(np.median(self.judgement.table.sigma)), self.judgement.test.noise
        if self.readings.assumed:
            words.append(WORDS["assumed"])
        if self.model_error > 0.5 * noise:
            words.append(WORDS["reduced"].format(error=1e6 * self.model_error, noise=1e6 * noise))
        if scatter > _ROUGH and self.readings.stated:
            words.append(WORDS["rough"].format(scatter=scatter))
        if moves:
            words.append(WORDS["moves"])
        return words


def load_diagnosis(folder: Path) -> tuple[Json, dict[str, NDArray[Any]]]:
    """What :meth:`Diagnosis.save` wrote: the JSON object, and the columns of readings.csv [SI]."""
    return read_json(folder / "diagnosis.json"), read_own_sheet(folder / "readings.csv", COLUMNS)


def cause_names(causes: tuple[Cause, ...]) -> tuple[str, ...]:
    """Causes as words, in order."""
    return tuple(sorted(map(str, causes)))


def _where(judged: Judgement) -> str:
    """Where the misfit is: the strongest pattern, and the strongest of another kind.

    Of patterns that are about as strong the one is taken that says more: of a specimen before of
    all readings.
    """
    strength = {name: max(p, 1e-12) for name, p in judged.test.p_values.items()
                if name in judged.patterns and name != "ramps"}
    vague = {"level": 1e4, "fitted value": 1e3, "voltage": 10.0}
    order = sorted(strength, key=lambda name: strength[name] * vague.get(name, 1.0))
    others = [name for name in order[1:] if strength[name] < _CLEAR and name not in vague
              and name.split()[0] != order[0].split()[0]]
    return "; ".join(words_of(name) for name in order[:1] + others[:1])


def _rmse_um(residual: Array, table: ReadingTable) -> float:
    """Root mean square of a table's lengths' residuals, given over their noise [µm]."""
    return 1e6 * float(np.sqrt(np.mean((residual * table.sigma)[table.lengths] ** 2)))


def _parameters(fit: Fit, cause: Cause) -> Json:
    """The parameters of a cause at a fit, in the units to show, with 95 % limits; inf is None."""
    parameters: Json = {}
    first = sizes_of(fit.hypothesis, cause).start
    for number, parameter in enumerate(cause.effect.parameters, first):
        values = [parameter.shown(parameter.value(size)) for size in interval(fit, number)]
        limits = sorted(values[1:], key=lambda limit: limit if np.isfinite(limit) else np.inf)
        value, low, high = (item if np.isfinite(item) else None for item in (values[0], *limits))
        parameters[parameter.name] = {"value": value, "unit": parameter.unit, "low": low,
                                      "high": high}
    return parameters
