"""A diagnosis as a result: everything computed, as JSON, in a folder and read back from one."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.toml_writer import rig_to_toml, specimen_to_toml
from tympan.geometry.errors import InputError
from tympan.geometry.units import quantity
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.calibration import extended_setup
from tympan.studies.diagnosis.gain import GainReport, gain_of
from tympan.studies.diagnosis.inference.fit import Fit
from tympan.studies.diagnosis.inference.identifiability import Detectable, detectable_effects
from tympan.studies.diagnosis.inference.posterior import Posterior
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
from tympan.studies.diagnosis.reduced.hypothesis import Cause, sizes_of
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.text import AGAIN, limitations, where
from tympan.studies.effects import Setup
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
    wrong; ``gain`` on readings held out; ``proposals`` for the next experiment and ``advice`` in a
    sentence; ``single_effects`` each fitted alone; ``detectable``: what these readings can tell.
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
    detectable: tuple[Detectable, ...]

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
                   single_effects(simulation, judgement, causes),
                   detectable_effects(judgement.signatures))

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

    def json(self) -> Json:
        """The JSON object that the command prints, and what else the report shows."""
        judged, posterior = self.judgement, self.judgement.posterior
        # Whether the verdict or the named causes change with the priors' widths.
        moves = any(verdict != (judged.verdict, cause_names(judged.named))
                    for verdict in self.swept)
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
            "after": self._after(),
            "baseline": {name: dict(zip(("value", "low", "high"),
                                        np.exp(interval(judged.nominal, number)).tolist(),
                                        strict=True))
                         for number, name in enumerate(("stiffness_factor",
                                                        "permittivity_factor"))},
            "priors_swept": {"moves": moves, "verdicts": [verdict for verdict, _ in self.swept]},
            "model_error_um": 1e6 * self.model_error,
            "knowable": [effect.json() for effect in self.detectable],
            "warnings": limitations(self.dataset, self.readings, judged, self.model_error, moves),
        }

    def save(self, folder: Path) -> None:
        """Write the readings, the extended model and, last, diagnosis.json to a folder."""
        write_csv(folder / "readings.csv", _HEADER, self._rows())
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
        """The causes in question, most probable first, with their parameters."""
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
        """What the calibrated nominal model leaves."""
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
            "where": (where(judged) if self.verdict != "nothing"
                      else "nowhere: what is left is noise"),
            "ratios": ratios(table, predicted, names),
            "patterns": [{"what": words_of(name), "p_value": p} for name, p in p_values
                         if name in judged.patterns],
        }

    def _after(self) -> Json | None:
        """What the extended model leaves."""
        if self.chosen is None:
            return None
        test = self.judgement.after
        return {"rmse_um": _rmse_um(self.chosen.residual, self.judgement.table),
                "p_value": None if test is None else test.p_value,
                "effects": [str(cause) for cause in self.chosen.hypothesis]}

    def _next_experiment(self) -> Json | None:
        """The best experiment; None where nothing is to be told apart."""
        if self.verdict == "unexplained":
            return {"what": AGAIN, "separates": [], "expected_chi_squared": None, "menu": []}
        if not self.proposals:
            return None
        menu = [{"what": proposal.what, "separates": list(proposal.separates),
                 "expected_chi_squared": proposal.expected, "enough": proposal.enough}
                for proposal in self.proposals]
        best = next((entry for entry in menu if entry["enough"]), menu[0])
        return {"what": self.advice, "separates": best["separates"],
                "expected_chi_squared": best["expected_chi_squared"], "menu": menu}

    def _rows(self) -> Iterator[tuple[object, ...]]:
        """The readings in SI, with what both models say."""
        table, nominal = self.judgement.table, self.judgement.nominal
        specimens = np.array([specimen.name for specimen in self.simulation.setup.specimens])
        columns = (table.file, table.line, table.kind, specimens[table.specimen],
                   table.mass / quantity("1 g", "mass"),
                   table.voltage / quantity("1 kV", "voltage"),
                   table.states.elapsed[table.state], table.order, table.value, table.sigma,
                   table.value - nominal.residual * table.sigma,
                   table.value - (self.chosen or nominal).residual * table.sigma)
        return zip(*(column.tolist() for column in columns), strict=True)


def load_diagnosis(folder: Path) -> tuple[Json, dict[str, NDArray[Any]]]:
    """What :meth:`Diagnosis.save` wrote: the JSON object, and the columns of readings.csv by name.

    Columns have shape (rows,), lengths in m: numbers but for file, kind and specimen.

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
    return content, columns


def cause_names(causes: tuple[Cause, ...]) -> tuple[str, ...]:
    """Causes as words, in order."""
    return tuple(sorted(map(str, causes)))


def _rmse_um(residual: Array, table: ReadingTable) -> float:
    """Root mean square of a table's lengths' residuals, given over their noise [µm]."""
    return 1e6 * float(np.sqrt(np.mean((residual * table.sigma)[table.lengths] ** 2)))


def _parameters(fit: Fit, cause: Cause) -> Json:
    """The parameters of a cause at a fit, in the units to show, with 95 % limits.

    None stands for what is infinite.
    """
    parameters: Json = {}
    first = sizes_of(fit.hypothesis, cause).start
    for number, parameter in enumerate(cause.effect.parameters, first):
        values = [parameter.shown(parameter.value(size)) for size in interval(fit, number)]
        limits = sorted(values[1:], key=lambda limit: limit if np.isfinite(limit) else np.inf)
        value, low, high = (item if np.isfinite(item) else None for item in (values[0], *limits))
        parameters[parameter.name] = {"value": value, "unit": parameter.unit, "low": low,
                                      "high": high}
    return parameters
