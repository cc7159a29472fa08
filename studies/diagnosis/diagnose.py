"""Diagnosis of a dataset, and plan of what its readings can show before they are made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tympan.base.errors import InputError
from tympan.base.progress import PartsDone
from tympan.studies.case import Settings
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.bench_errors import with_bench_errors, with_model_error
from tympan.studies.diagnosis.calibration import (
    Calibration,
    calibrated,
    law_error,
    reaching,
    with_effects,
    with_masses,
)
from tympan.studies.diagnosis.conclusions import Conclusions
from tympan.studies.diagnosis.evidence.coupon_readings import WORDS, coupon_readings
from tympan.studies.diagnosis.evidence.coupons import BATCH, CouponTests
from tympan.studies.diagnosis.evidence.held import Held
from tympan.studies.diagnosis.evidence.kind import PreparedReadings
from tympan.studies.diagnosis.evidence.rest import Rest
from tympan.studies.diagnosis.explanations.frames import other_frame
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.identifiability import (
    classes_of,
    detectable_effects,
    signatures,
)
from tympan.studies.diagnosis.inference.nominal import with_noise_found
from tympan.studies.diagnosis.inference.verdict import Judgement, judge
from tympan.studies.diagnosis.reading_table import ReadingTable, States
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.result import Diagnosis
from tympan.studies.diagnosis.self_check import Bench
from tympan.studies.effects import EFFECTS, Setup
from tympan.studies.estimation.noise import Shared
from tympan.studies.files import to_json

#: Number of parts of the work after the films: weighing hypotheses and testing their predictions.
_LATER = 2
#: Files with deflections of a film's centre as well as of a plate, or without an actuator.
_OF_THE_CENTRE = frozenset((*Rest.files, *CouponTests.files))


def by_formula(dataset: Dataset, formula: str | None) -> Dataset:
    """Judge a dataset by a registered film in closed form; None for finite elements."""
    return replace(dataset, formula=Settings(formula=formula).formula)


def diagnose(dataset: Dataset, workers: int = 1, seed: int = 0) -> Diagnosis:
    """Diagnose a dataset as :func:`conclude` does; return the result without film shapes."""
    return conclude(dataset, workers, seed).diagnosis()


def conclude(dataset: Dataset, workers: int = 1, seed: int = 0,
             progress: PartsDone = lambda done, all_of_them: None) -> Conclusions:
    """Diagnose a dataset's static readings, ranges, frequencies and scans of films, and coupons.

    Coupons are judged separately, by the same rules, and then weighed with the readings of
    actuators of the same film, if there are some.

    Parameters
    ----------
    workers
        Processes for the finite elements; with more than one the calling script needs a main guard.
    seed
        Seed of the draws for critical values; another one moves probabilities by sampling error.
    progress
        Called with the parts of the work done and their number.

    Raises
    ------
    InputError
        When nothing can be concluded: too few readings, a column in a wrong unit, films that cannot
        be solved, scans in another frame than stated, effects of a user's package that cannot be
        loaded.
    """
    EFFECTS.whole()
    if dataset.coupons is None:
        return Conclusions.of(dataset, *judge_dataset(dataset, workers, seed, progress), seed)
    of_coupons = judge_coupons(dataset, seed)
    coupons = Conclusions.of(dataset, *of_coupons, seed=seed)
    if of_coupons_alone(dataset):
        return coupons
    of_actuators = _judge_actuators(dataset, of_coupons, workers, seed, progress)
    return replace(Conclusions.of(dataset, *of_actuators, seed), coupons=coupons)


def judge_dataset(dataset: Dataset, workers: int = 1, seed: int = 0,
                  progress: PartsDone = lambda done, all_of_them: None
                  ) -> tuple[PreparedReadings, Judgement, float]:
    """Judge a dataset; return its prepared readings, the verdict, and the reduced model's errors.

    The noise of the readings contains these errors. :func:`conclude` does the same and adds the
    conclusions from the verdict.
    """
    of_coupons = None if dataset.coupons is None else judge_coupons(dataset, seed)
    if of_coupons is not None and of_coupons_alone(dataset):
        return (*of_coupons, 0.0)
    return _judge_actuators(dataset, of_coupons, workers, seed, progress)


def calibrated_readings(dataset: Dataset) -> tuple[PreparedReadings, Calibration, float]:
    """Prepare the readings of actuators with all errors in their noise, and calibrate.

    Return the readings, the nominal simulation and the error of its lengths [m].
    """
    readings = _prepared(dataset)
    nominal = calibrated(readings.setup, readings.table)
    frame = other_frame(nominal.simulation, nominal.table,
                        "frame" if dataset.field_frame == "table" else "plate")
    if frame is not None:
        raise InputError(f"{frame.what}: {frame.check}", key="field.csv")
    error = law_error(nominal.simulation, nominal.fit, nominal.table)
    table = with_model_error(nominal.table, error, nominal)
    readings = replace(readings, table=table, remarks=(*readings.remarks, *nominal.remarks))
    return with_bench_errors(readings, dataset, nominal), nominal, error


def _judge_actuators(dataset: Dataset, of_coupons: tuple[PreparedReadings, Judgement] | None,
                     workers: int, seed: int, progress: PartsDone
                     ) -> tuple[PreparedReadings, Judgement, float]:
    """Judge as :func:`judge_dataset` does; ``of_coupons`` is the judgement of coupons alone."""
    _require_lengths(dataset)
    readings, nominal, error = calibrated_readings(dataset)
    films = 1

    def solved(done: int, count: int) -> None:
        nonlocal films
        films = count
        progress(done, count + _LATER)

    simulation = with_effects(nominal.simulation, solved, workers)
    progress(films, films + _LATER)
    try:
        readings, simulation, every = with_coupons(readings, simulation, of_coupons,
                                                   readings.causes)
        judged = judge(simulation, every, readings.causes, seed=seed, workers=workers)
    except ArithmeticError as failure:
        raise InputError(str(failure), key="readings",
                         given=f"{len(readings.table)} readings") from None
    progress(films + 1, films + _LATER)
    if judged.chosen is not None:
        assert isinstance(judged.simulation, Simulation)
        error = max(error, law_error(judged.simulation, judged.chosen, readings.table))
    return readings, judged, error


def with_coupons(readings: PreparedReadings, simulation: Simulation,
                 of_coupons: tuple[PreparedReadings, Judgement] | None, causes: Sequence[Cause]
                 ) -> tuple[PreparedReadings, Simulation, ReadingTable]:
    """Add coupons of the same film, if there are some; estimate the noise of both.

    The noise of the actuators is the scatter that the effects of ``causes`` leave.
    """
    if of_coupons is None:
        return readings, simulation, readings.table
    coupons, judged = of_coupons
    (tests,) = coupons.evidence
    assert isinstance(tests, CouponTests)
    if not tests.of_one_film(readings.setup):
        remark = WORDS["other_film"]
        readings = replace(readings, remarks=(*readings.remarks, remark))
        return readings, simulation, readings.table
    table = with_noise_found(simulation, readings.table, causes)
    remark = WORDS["together"].format(count=len(judged.table), share=BATCH)
    together = replace(readings, coupons=coupons, remarks=(*readings.remarks, remark))
    return together, *weighed_together(simulation, table, tests, judged)


def weighed_together(simulation: Simulation, table: ReadingTable, tests: CouponTests,
                     coupons: Judgement) -> tuple[Simulation, ReadingTable]:
    """Add coupons to a simulation of actuators, and the coupons' rows to their table.

    The ``coupons`` were judged separately before, which also gave their noise. Their stiffness and
    permittivity equal those of the actuators within a share, :data:`BATCH`. This difference is
    integrated over, as an error that all strips have in common.
    """
    best = coupons.chosen or coupons.nominal
    batch = tests.batch(coupons.simulation.extended(best.hypothesis, best.unknowns))
    of_batch = Shared.of(np.arange(len(coupons.table)), batch)
    noise = coupons.table.noise.known(coupons.test.freedom).plus(of_batch)
    # All rows get one state, that of a plate with some mass, fixed where the film is flat.
    mass = float(table.states.mass.max(initial=0.0))
    flat = replace(States.of([0], [mass], [0.0]), deflection=np.zeros(1))
    strips = replace(coupons.table, states=flat, state=0 * coupons.table.state, noise=noise)
    return (replace(simulation, evidence=(*simulation.evidence, tests)), table.joined(strips))


def of_coupons_alone(dataset: Dataset) -> bool:
    """Check whether a dataset has readings of coupons and no others."""
    return set(dataset.tables) <= set(CouponTests.files)


def judge_coupons(dataset: Dataset, seed: int) -> tuple[PreparedReadings, Judgement]:
    """Judge a dataset's coupons alone."""
    readings = coupon_readings(dataset)
    simulation = Simulation(readings.setup, (), evidence=readings.evidence)
    try:
        return readings, judge(simulation, readings.table, readings.causes, seed=seed)
    except ArithmeticError as failure:
        raise InputError(str(failure), key="readings",
                         given=f"{len(readings.table)} readings of coupons") from None


def plan_readings(dataset: Dataset, workers: int = 1,
                  progress: PartsDone = lambda done, all_of_them: None
                  ) -> tuple[dict[str, Any], Bench]:
    """List the effects that a dataset's readings can show, as a JSON object, and its bench.

    The result holds whatever was or will be read: the values of readings are not used. The bench
    makes synthetic readings like these. Raise an :class:`InputError` where a planned state has no
    equilibrium.
    """
    _require_lengths(dataset)
    readings = _prepared(dataset)
    table = _predicted(readings.setup, readings.table)
    nominal = calibrated(readings.setup, table)
    simulation = with_effects(nominal.simulation, progress, workers)
    signs = signatures(simulation, table, nominal.fit.unknowns, readings.causes)
    invisible, classes = classes_of(signs)
    noisy = with_model_error(table, law_error(nominal.simulation, nominal.fit, table), nominal)
    noisy = with_bench_errors(replace(readings, table=noisy), dataset, nominal).table
    bench = Bench(simulation, nominal.fit.unknowns, noisy, readings.causes)
    return {
        "dataset": dataset.name,
        "readings": len(table),
        "noise_um": 1e6 * float(np.sqrt(np.mean(table.sigma[table.lengths] ** 2))),
        "noise_from": table.noise.source,
        "not_visible": sorted({str(cause) for cause in invisible}),
        "indistinguishable": [[str(cause) for cause in group] for group in classes],
        "effects": to_json(detectable_effects(signs)),
    }, bench


def _require_lengths(dataset: Dataset) -> None:
    """Refuse forces without deflections: a diagnosis measures its errors by deflections."""
    if set(dataset.tables) - set(CouponTests.files) == set(Held.files):
        raise InputError("must have static.csv or range.csv beside force.csv, as errors are "
                         "counted on deflections; tympan material fit takes forces alone",
                         key=dataset.name)


def _prepared(dataset: Dataset) -> PreparedReadings:
    if dataset.formula is not None:
        _require_formula(dataset)
    alone = [specimen.name for specimen in dataset.specimens if specimen.plate is None]
    if alone:
        _require_centres(dataset, alone)
    return prepared_readings(dataset)


def _require_formula(dataset: Dataset) -> None:
    """Refuse readings of what films in closed form do not have: a shape, and a memory."""
    for sheet in (dataset.fields, dataset.transients):
        if sheet is not None:
            raise InputError("must be left out: a film in closed form has neither a shape nor a "
                             "memory", key=sheet.file.name, given=dataset.formula)


def _require_centres(dataset: Dataset, alone: list[str]) -> None:
    """Refuse readings that films without a plate do not have."""
    others, static = set(dataset.tables) - _OF_THE_CENTRE, dataset.static
    if others:
        raise InputError(f"has no plate, which {' and '.join(sorted(others))} is read of: leave it "
                         f"out; {' and '.join(Rest.files)} may have the deflection of the centre",
                         key="specimen", given=" and ".join(alone))
    if len(alone) == len(dataset.specimens):
        try:
            dataset.rig.require_no_plate_loads()
        except InputError as error:
            raise error.located(file="dataset.toml") from None
    if static is not None:
        for row in np.flatnonzero(np.isin(static.specimen, alone) & np.isfinite(static.tilt)):
            raise static.error(int(row), "tilt", "must be left out: the film has no plate")


def _predicted(setup: Setup, table: ReadingTable) -> ReadingTable:
    simulation = reaching(setup, table, lambda simulation: np.zeros(2))
    simulation = with_masses(simulation)
    values = simulation.predict((), np.zeros(2), table)
    if np.isfinite(values).all():
        return table.with_values(values)
    row = int(np.flatnonzero(~np.isfinite(values))[0])
    raise InputError("the nominal model has no equilibrium there: plan a lower voltage or mass",
                     key="readings",
                     given=f"{setup.specimens[int(table.specimen[row])].name}, "
                           f"{1e3 * table.mass[row]:.4g} g, {1e-3 * table.voltage[row]:.4g} kV")
