"""A diagnosis written down by hand."""

from __future__ import annotations

from typing import Any

from tympan.studies.diagnosis.result import (
    After,
    Coverage,
    Diagnosis,
    Factor,
    FoundCause,
    Gain,
    Misfit,
    NextExperiment,
    NoEffect,
    Noisier,
    Robust,
    Verdict,
)


def diagnosed(verdict: Verdict, *causes: FoundCause, **others: Any) -> Diagnosis:
    """A diagnosis of readings in micrometres that says these causes."""
    factor = Factor(1.0, 0.9, 1.1)
    return Diagnosis(**{
        "dataset": "bench", "verdict": verdict, "headline": "Every load is 20 g heavier (99 %).",
        "causes": causes, "model_error": 0.1, "noisier": Noisier(1.5, 0.961),
        "next_experiment": NextExperiment(what="", after_checks="hang 10 g", checks=tuple(
            cause.check for cause in causes)),
        "misfit": Misfit(baseline_rmse=61.2, noise=20.0, noise_from="stated", p_value=1e-9,
                         noise_over_stated=1.3, where="the way it depends on mass is wrong"),
        "after": After(rmse=21.8, p_value=0.5, effects=(causes[0].effect,)),
        "gain": Gain(held_out="each mass in turn (10 g, 20 g)", rmse_before=61.0, rmse_after=22.0,
                     ratio=0.2, low=None, high=None),
        "predictive": Coverage(coverage_95=0.944, readings=90, pit=(9,) * 10),
        "robust": tuple(Robust(factor, (causes[0].effect,)) for factor in (1 / 3, 1.0, 10.0)),
        "probability": NoEffect(0.0, 0.01),
        "baseline": {"stiffness_factor": factor, "permittivity_factor": factor}, **others})
