"""Labels that look exchanged or a row off: put right, they explain what any effects do."""

from __future__ import annotations

import numpy as np

from tympan.studies.data.findings import Finding
from tympan.studies.diagnosis.explanations.kind import Explanation, Written
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.inference.relabelled import Relabelling, relabelling_of
from tympan.studies.diagnosis.inference.verdict import ALARM, EXCLUDED, MORE, Judgement
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.sentences import WORDS, plain

#: How many effects are asked whether they explain the readings with other labels: a real one may
#: be there besides.
_BESIDE = 2


def wrong_labels(judged: Judgement, written: Written | None = None) -> Explanation | None:
    """Labels that, put right, let the nominal model or one effect explain the readings."""
    labels = other_labels(judged)
    if labels is None:
        return None
    return Explanation.of(Finding("labels", _words(judged, labels), labels.file, labels.lines,
                                  WORDS["do_labels"]))


def other_labels(judged: Judgement) -> Relabelling | None:
    """Other labels that explain as much as any effects do with those stated.

    All effects may miss :data:`MORE` of χ² less; and a film of its own for the odd specimen must
    miss more by :data:`EXCLUDED`.
    """
    misfit = judged.misfit
    if judged.test.p_value >= ALARM or not misfit.simulation.loaded:
        return None
    # Other labels may explain what was taken for readings that are off by themselves.
    table = misfit.table.with_noise(misfit.table.noise.ordinary)

    def missed(one: Fit) -> float:
        return float(np.sum(table.noise.whitened(misfit.missed_by(one).residual) ** 2))

    by_effects = min(map(missed, judged.fits), default=np.inf)
    most = min(by_effects + MORE, _with_a_film_of_its_own(judged, table) - EXCLUDED)
    singles = sorted((fit for fit in judged.weighed.alone if fit.possible),
                     key=lambda fit: fit.chi_squared)
    found = list[Relabelling]()
    for fitted in (misfit.fit, *singles[:_BESIDE]):
        if misfit.terms:
            fitted = fit(judged.simulation, fitted.hypothesis, table, fitted.unknowns)
        relabelling = relabelling_of(judged.simulation, table, fitted)
        if relabelling and relabelling.after < most:
            found.append(relabelling)
            if relabelling.plain:
                break
    return min(found, key=lambda one: one.after + EXCLUDED * len(one.hypothesis), default=None)


def _with_a_film_of_its_own(judged: Judgement, table: ReadingTable) -> float:
    """χ² with factors of its own for the film of the odd specimen; infinite where there is none."""
    specimens = judged.simulation.setup.specimens
    odd = [specimens[number].name == judged.weighed.odd_specimen
           for number in table.specimen.tolist()]
    if not any(odd):
        return np.inf
    fits = [fit(judged.simulation, (), table[rows].compact(), judged.nominal.unknowns)
            for rows in (np.array(odd), ~np.array(odd))]
    return sum(one.chi_squared for one in fits) if all(one.possible for one in fits) else np.inf


def _words(judged: Judgement, labels: Relabelling) -> str:
    """Labels that look wrong, and what the simulation misses as it is and with them put right."""
    noise = 1e6 * float(np.median(judged.table.sigma[judged.table.lengths]))
    before, after = (noise * (chi_squared / len(judged.table)) ** 0.5
                     for chi_squared in (labels.before, labels.after))
    part, key = labels.part, "exchanged" if labels.pair else "one_row_off"
    parts = {"of": part.specimen, "under": part.mass, "lines": part.file}
    where = "".join(WORDS[name].format(part=part) for name, there in parts.items() if there)
    where += WORDS["only"] if where else ""
    effects = " and ".join(plain(str(cause)) for cause in labels.hypothesis)
    return WORDS[key].format(labels=labels, where=where, before=before, after=after,
                             way="low" if labels.rows > 0 else "high",
                             simulation=WORDS["beside" if effects else "alone"].format(effects))
