"""A diagnosis on disk: diagnosis.json of design §6, the readings with both models, and the extended model as TOML."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tympan.fem.toml_writer import rig_to_toml, specimen_to_toml
from tympan.geometry.errors import InputError
from tympan.geometry.units import quantity
from tympan.studies.diagnosis.diagnose import Diagnosis, rmse
from tympan.studies.diagnosis.inference.fit import Fit
from tympan.studies.diagnosis.inference.identifiability import knowable
from tympan.studies.diagnosis.inference.ratios import ratios
from tympan.studies.diagnosis.inference.single_effects import Attempt, attempts
from tympan.studies.diagnosis.inference.verdict import Judgement, interval
from tympan.studies.diagnosis.plan import detectable
from tympan.studies.diagnosis.reduced.simulation import Cause
from tympan.studies.diagnosis.validation.gain import GainReport, SplitGain
from tympan.studies.effects import EffectParameter
from tympan.studies.files import write_csv, write_json, write_text

#: Causes of less than this probability are not listed.
_LEAST = 0.01

#: The next experiment where no effect explains a misfit.
_AGAIN = ("mount the specimens again and repeat the readings, up and down: see whether the misfit is there again, and "
          "how large the noise is, before looking for an effect nobody has thought of")

#: Patterns that noise shows less often than this are told too.
_CLEAR = 1e-3


def as_json(found: Diagnosis) -> dict[str, Any]:
    """The JSON object of design §6 and, beyond it, what else the report shows."""
    judged = found.judgement
    return {
        "dataset": found.dataset.name,
        "verdict": found.verdict,
        "causes": [] if judged.weighing is None else causes(found),
        "indistinguishable": [sorted({cause.effect for cause in group})
                              for group in judged.indistinguishable],
        "misfit": misfit(found),
        "gain": gain(found.gain),
        "next_experiment": next_experiment(found),
        "not_visible": sorted({cause.effect for cause in judged.invisible}),
        "probability": {"nothing": 1.0 if judged.weighing is None else judged.weighing.nothing,
                        "unknown": 0.0 if judged.weighing is None else judged.weighing.unknown},
        "attempts": [_attempt(one) for one in attempts(
            found.simulation, judged, found.readings.causes)],
        "after": None if found.chosen is None else after(found, found.chosen),
        "baseline": baseline(judged.nominal),
        "priors_swept": {"moves": found.moves, "verdicts": [verdict for verdict, _ in found.swept]},
        "model_error_um": 1e6 * found.model_error,
        "knowable": [detectable(one) for one in knowable(
            found.simulation, judged.table, judged.nominal.unknowns,
            found.readings.causes).effects],
        "warnings": found.warnings(),
    }


def causes(found: Diagnosis) -> list[dict[str, Any]]:
    """The causes that come into question, most probable first, with the parameters of the best hypothesis of each."""
    weighing = found.judgement.weighing
    assert weighing is not None
    listed = []
    for cause, probability in weighing.of_causes().items():
        if probability >= _LEAST or cause in found.judgement.suspects:
            one = weighing.fit_of((cause,)) or weighing.with_cause(cause)
            named = found.chosen if found.chosen is not None and cause in found.chosen.hypothesis else one
            listed.append({"effect": cause.effect, "which": cause.which, "probability": probability,
                           "parameters": parameters(named, cause)})
    return listed


def parameters(one: Fit, cause: Cause) -> dict[str, Any]:
    """The parameters of a cause at a fit, in the units to show, with 95 % limits."""
    first = 2
    found: dict[str, Any] = {}
    for other in one.hypothesis:
        items = other.of_registry.parameters
        if other == cause:
            for number, item in enumerate(items):
                value, *limits = (_shown(item, size) for size in interval(one, first + number))
                low, high = sorted(limits, key=lambda limit: np.inf if limit is None else limit)
                found[item.name] = {"value": value, "unit": item.unit, "low": low, "high": high}
        first += len(items)
    return found


def _shown(item: EffectParameter, size: float) -> float | None:
    """A size as the value to show; None where it is infinite."""
    value = item.shown(item.value(size))
    return value if np.isfinite(value) else None


def misfit(found: Diagnosis) -> dict[str, Any]:
    """What the calibrated nominal model leaves."""
    judged = found.judgement
    lengths = np.isin(judged.table.kind, ("displacement", "range"))
    words = {pattern.name: pattern.words for pattern in judged.patterns}
    names = [specimen.name for specimen in found.simulation.setup.specimens]
    predicted = judged.table.value - judged.nominal.residual * judged.table.sigma
    return {
        "baseline_rmse_um": 1e6 * rmse(judged.nominal.residual[lengths],
                                       judged.table.sigma[lengths]),
        "noise_um": 1e6 * float(np.sqrt(np.mean(judged.table.sigma[lengths] ** 2))),
        "noise_from": found.readings.noise_from,
        "noise_over_stated": judged.test.noise,
        "p_value": judged.test.p_value,
        "where": where(judged) if found.verdict != "nothing" else "nowhere: what is left is noise",
        "ratios": [{**asdict(one), "off_by_noise": one.off}
                   for one in ratios(judged.table, predicted, names)],
        "patterns": [{"what": words[name], "p_value": p} for name, p in
                     sorted(judged.test.p_values.items(), key=lambda item: item[1])
                     if name in words],
    }


def where(judged: Judgement) -> str:
    """Where the misfit is, in words: the strongest pattern, and the strongest one of another kind if there is one.

    Of patterns that are about as strong the one is taken that says more: of a specimen before of
    all readings.
    """
    words = {pattern.name: pattern.words for pattern in judged.patterns if pattern.name != "ramps"}
    strength = {name: max(p, 1e-12) for name, p in judged.test.p_values.items() if name in words}
    vague = {"level": 1e4, "fitted value": 1e3, "voltage": 10.0}
    order = sorted(strength, key=lambda name: strength[name] * vague.get(name, 1.0))
    told = order[:1] + [name for name in order[1:] if strength[name] < _CLEAR
                        and name.split()[0] != order[0].split()[0]
                        and name not in vague][:1]
    return "; ".join(words[name] for name in told)


def after(found: Diagnosis, one: Fit) -> dict[str, Any]:
    """What the extended model leaves."""
    table, test = found.judgement.table, found.judgement.after
    lengths = np.isin(table.kind, ("displacement", "range"))
    return {"rmse_um": 1e6 * rmse(one.residual[lengths], table.sigma[lengths]),
            "p_value": None if test is None else test.p_value,
            "effects": [str(cause) for cause in one.hypothesis]}


def gain(found: GainReport) -> dict[str, Any] | None:
    """The gain of design §6, and that of each split."""
    if found.overall is None:
        return None
    return {**asdict(found.overall), "splits": [_split(one) for one in found.splits],
            "impossible": list(found.impossible)}


def _split(one: SplitGain) -> dict[str, Any]:
    errors = {key: 1e6 * value if np.isfinite(value) else None for key, value in one.rmse.items()}
    return {"held_out": one.split.held_out, "chosen": [str(cause) for cause in one.chosen],
            "wrong": [str(cause) for cause in one.wrong], "rmse_um": errors, "note": one.note}


def next_experiment(found: Diagnosis) -> dict[str, Any] | None:
    """The best experiment in words; None where nothing is to be told apart."""
    if found.verdict == "unexplained":
        return {"what": _AGAIN, "separates": [], "expected_chi_squared": None, "menu": []}
    proposals = found.proposals
    if not proposals.ranked:
        return None
    best = next((one for one in proposals.ranked if one.enough), proposals.ranked[0])
    return {"what": proposals.sentence, "separates": list(best.effects),
            "expected_chi_squared": best.expected,
            "menu": [{"what": one.what, "separates": list(one.effects),
                      "expected_chi_squared": one.expected,
                      "enough": one.enough} for one in proposals.ranked]}


def _attempt(one: Attempt) -> dict[str, Any]:
    return {"effect": one.cause.effect, "which": one.cause.which, "explains": one.share,
            "parameters": parameters(one.fit, one.cause), "prior_widths": one.widths,
            "plausible": one.plausible,
            "at_limit": one.bounded}


def baseline(nominal: Fit) -> dict[str, Any]:
    """The refitted factors on stiffness and permittivity, with 95 % limits."""
    found = {}
    for number, name in enumerate(("stiffness_factor", "permittivity_factor")):
        value, low, high = np.exp(interval(nominal, number)).tolist()
        found[name] = {"value": value, "low": low, "high": high}
    return found


def write(found: Diagnosis, content: dict[str, Any], folder: Path) -> None:
    """Write a diagnosis to a folder; diagnosis.json last, so that it stands beside nothing unfinished."""
    write_csv(folder / "readings.csv", _HEADER, _rows(found))
    for name, text in _extended(found):
        write_text(folder / "extended" / name, text)
    write_json(folder / "diagnosis.json", content)


_HEADER = ("file", "line", "kind", "specimen", "mass_g", "voltage_kV", "elapsed_s", "order", "read",
           "sigma",
           "baseline", "extended")


def _rows(found: Diagnosis) -> Iterator[tuple[object, ...]]:
    """The readings in SI, with what both models say."""
    judged, table = found.judgement, found.judgement.table
    nominal = table.value - judged.nominal.residual * table.sigma
    best = nominal if found.chosen is None else table.value - found.chosen.residual * table.sigma
    specimens = [specimen.name for specimen in found.simulation.setup.specimens]
    elapsed = table.states.elapsed[table.state]
    gram, kilovolt = quantity("1 g", "mass"), quantity("1 kV", "voltage")
    for row in range(len(table)):
        yield (str(table.file[row]), int(table.line[row]), str(table.kind[row]),
               specimens[int(table.specimen[row])],
               float(table.mass[row] / gram), float(table.voltage[row] / kilovolt),
               float(elapsed[row]),
               float(table.order[row]), float(table.value[row]), float(table.sigma[row]),
               float(nominal[row]),
               float(best[row]))


def _extended(found: Diagnosis) -> Iterator[tuple[str, str]]:
    """The files of the extended model."""
    setup = found.extended
    if setup is None:
        return
    yield "rig.toml", rig_to_toml(setup.rig)
    for specimen in setup.specimens:
        try:
            yield f"{specimen.name}.toml", specimen_to_toml(specimen)
        except InputError as error:
            yield f"{specimen.name}.txt", f"{error}\n"
