"""Labels that look exchanged or shifted by a row; corrected, they explain as much as any effect."""

from __future__ import annotations

import numpy as np

from tympan.studies.data.findings import Finding
from tympan.studies.diagnosis.explanations.kind import Explanation, Written
from tympan.studies.diagnosis.explanations.relabelled import Relabelling, relabelling_of
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.inference.verdict import ALARM, Judgement
from tympan.studies.diagnosis.inference.weighing import EXCLUDED, MORE
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.sentences import WORDS, plain

#: Number of effects that are tested on the readings with corrected labels: a real effect may be
#: present as well.
_BESIDE = 2


def wrong_labels(judged: Judgement, written: Written | None = None) -> Explanation | None:
    """Find labels whose correction lets the nominal model or one effect explain the readings."""
    labels = other_labels(judged)
    if labels is None:
        return None
    return Explanation.of(Finding("labels", _words(judged, labels), labels.file, labels.lines,
                                  WORDS["do_labels"]))


def other_labels(judged: Judgement) -> Relabelling | None:
    """Find other labels that explain as much as any effects do with the stated labels.

    All effects together may leave at most :data:`MORE` of χ² less. A separate film for the odd
    specimen must leave at least :data:`EXCLUDED` more.
    """
    misfit = judged.misfit
    if judged.test.p_value >= ALARM or not misfit.simulation.loaded:
        return None
    # Corrected labels may explain readings that were taken for outliers.
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
    """Compute χ² with separate factors for the odd specimen's film; infinite without one."""
    specimens = judged.simulation.setup.specimens
    odd = [specimens[number].name == judged.weighed.odd_specimen
           for number in table.specimen.tolist()]
    if not any(odd):
        return np.inf
    fits = [fit(judged.simulation, (), table[rows].compact(), judged.nominal.unknowns)
            for rows in (np.array(odd), ~np.array(odd))]
    return sum(one.chi_squared for one in fits) if all(one.possible for one in fits) else np.inf


def _words(judged: Judgement, labels: Relabelling) -> str:
    """Describe labels that look wrong, and the simulation's misfit before and after correction."""
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
