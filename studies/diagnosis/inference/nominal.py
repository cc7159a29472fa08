"""Residuals of the nominal model, and the noise of readings that they show."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtri

from tympan.base.arrays import Array, Mask, Numbers
from tympan.studies.diagnosis.evidence.kind import ReadingModel, rows_of_kinds
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit, nominal_fit
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.identifiability import Signatures, classes_of, signatures
from tympan.studies.diagnosis.inference.noise_terms import (
    WANDERS,
    Jump,
    Missed,
    Smooth,
    chain_of,
    noise_terms,
    same_terms,
)
from tympan.studies.diagnosis.inference.residual_tests import ResidualTests
from tympan.studies.diagnosis.inference.smooth_misfit import smooth_columns
from tympan.studies.diagnosis.patterns.reading_patterns import EACH_RUN, JUMPS, among, over
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.estimation.noise import STATED, Noise, NoiseTerm

#: Most times that force laws are extended for the nominal fit.
_REACHES = 3

#: Least factor on the assumed noise of a channel.
_QUIETEST = 0.05

#: Confidence with which a channel's scatter excludes a larger noise.
_EXCLUDES = 0.9

#: Least share of a channel's readings that all patterns together must leave to determine its noise.
_SHARE = 0.5

#: Readings of a channel from which single outliers hardly change its noise.
_SINGLE = 200

#: Ratio of a channel's scatter about smooth curves to its stated noise from which the stated noise
#: is wrong: people understate it by a factor of two, hardly by more.
UNLIKE = 3.0
#: Fewest degrees of freedom of a scatter about smooth curves.
_KNOWN = 5.0

#: Message where no noise can be estimated.
TOO_FEW = "there are too few readings to tell a misfit from noise"


@dataclass(frozen=True, eq=False)
class NominalMisfit:
    """The fit of the nominal model to a table's readings.

    ``causes``: effects that may be wrong; ``patterns``: columns that its misfit may combine, in
    units of the readings, by name; ``stated``: the noise without ``terms``, those that the readings
    show; ``scatter``: scatter about smooth curves over the stated noise, by kind of channel, where
    both are known.
    """

    simulation: ReadingModel
    table: ReadingTable
    causes: tuple[Cause, ...]
    fit: Fit
    patterns: dict[str, Array]
    stated: Noise
    terms: tuple[NoiseTerm, ...] = ()
    scatter: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, simulation: ReadingModel, table: ReadingTable, causes: Sequence[Cause],
           workers: int = 1, terms: Sequence[NoiseTerm] | None = None) -> NominalMisfit:
        """Fit a simulation, extended as far as the fit needs.

        ``terms`` of the noise are by default those that the misfit shows.
        Raise ArithmeticError where there is no equilibrium at the readings' states.
        """
        nominal = nominal_fit(simulation, table)
        for _ in range(_REACHES):
            if nominal.possible or nominal.short == np.inf:
                break
            simulation = simulation.further(workers)
            nominal = nominal_fit(simulation, table)
        if not nominal.possible:
            raise ArithmeticError("the nominal model has no equilibrium at the states that were "
                                  "read")
        misfit = cls(simulation, table, tuple(causes), nominal,
                     _patterns(simulation, table, nominal), table.noise)
        misfit = misfit._with_noise_of_channels()
        misfit = replace(misfit, stated=misfit.table.noise)
        misfit = (misfit.with_terms(misfit.shown_terms()) if terms is None
                  else misfit._fitted_with(terms))
        if table.noise.common and not table.lengths.any():
            # Errors correlated along strips are separated from noise once its size is known.
            misfit = misfit.louder(misfit.tests.noise(misfit.fit.residual))
        return misfit

    @cached_property
    def signatures(self) -> Signatures:
        """Signatures of the causes in the readings."""
        return signatures(self.simulation, self.table, self.fit.unknowns, self.causes)

    @property
    def invisible(self) -> tuple[Cause, ...]:
        """Causes that these readings cannot show."""
        return self._classes[0]

    @property
    def indistinguishable(self) -> tuple[tuple[Cause, ...], ...]:
        """Classes of causes that these readings cannot distinguish."""
        return self._classes[1]

    @cached_property
    def _classes(self) -> tuple[tuple[Cause, ...], tuple[tuple[Cause, ...], ...]]:
        return classes_of(self.signatures)

    @property
    def rough(self) -> dict[str, float]:
        """Scatter of the channels whose stated noise is too small."""
        return {kind: scatter for kind, scatter in self.scatter.items() if scatter > UNLIKE}

    @property
    def quiet(self) -> dict[str, float]:
        """Scatter of the channels whose stated noise is too large."""
        return {kind: scatter for kind, scatter in self.scatter.items() if scatter < 1 / UNLIKE}

    def part(self, rows: Mask, simulation: ReadingModel) -> NominalMisfit:
        """Restrict the misfit to some readings, which a simulation predicts."""
        patterns = {name: values[rows] for name, values in self.patterns.items()
                    if values[rows].any()}
        return replace(self, simulation=simulation, table=self.table[rows].compact(),
                       fit=self.fit.part(rows), patterns=patterns, stated=self.stated[rows])

    @property
    def of_unknown_noise(self) -> NominalMisfit:
        """The misfit as if no noise were stated."""
        def unknown(noise: Noise) -> Noise:
            return replace(noise, freedom=0 * noise.freedom)

        return replace(self, stated=unknown(self.stated),
                       table=self.table.with_noise(unknown(self.table.noise)))

    def louder(self, factor: float) -> NominalMisfit:
        """Multiply the independent noise of each reading by a factor throughout."""
        table = self.table.with_noise(self.table.noise.times(factor))
        nominal = fit(self.simulation, (), table, self.fit.unknowns)
        return replace(self, table=table, fit=nominal)

    def shown_terms(self, remembers: bool = False, most: float = WANDERS) -> tuple[NoiseTerm, ...]:
        """Find the noise terms that readings show besides the model and each cause.

        ``remembers``: whether errors may be correlated; ``most``: see :func:`noise_terms`.
        """
        nominal, colour = self.missed_by(self.fit), self.table.noise.coloured
        beside = [replace(nominal, jacobian=np.hstack([nominal.jacobian, colour(values)]))
                  for values in self.signatures.values()]
        return self.terms_by([nominal, *beside], remembers, most)

    def terms_by(self, models: Sequence[Missed], remembers: bool, most: float = WANDERS
                 ) -> tuple[NoiseTerm, ...]:
        """Find the noise terms from the residuals of models."""
        chain = chain_of(self.table) if remembers else None
        return noise_terms(self.stated, models, self._rivals, chain, most)

    def as_a_sensor_that_wanders(self) -> NominalMisfit:
        """Change the noise as if the whole misfit were correlated errors."""
        missed = [self.missed_by(self.fit)]
        return self.with_terms(noise_terms(self.stated, missed, chain=chain_of(self.table)))

    def _rivals(self) -> Iterator[Smooth | Jump]:
        """Yield misfits that are no noise: jumps, patterns, and smooth processes.

        A separate deviation of each run is not among them: noise makes that, too.
        """
        for name in JUMPS:
            if name in self.patterns:
                yield Jump(self.patterns[name])
        few = [values for name, values in self.patterns.items() if name not in (*JUMPS, *EACH_RUN)]
        if few:
            yield Smooth(np.hstack(few))
        yield from map(Smooth, smooth_columns(self.table))

    def missed_by(self, fit: Fit) -> Missed:
        """Compute the residuals of a fit to the table."""
        colour = self.table.noise.coloured
        return Missed(colour(fit.residual), colour(fit.free_jacobian))

    def with_terms(self, terms: Sequence[NoiseTerm]) -> NominalMisfit:
        """Fit the misfit again with these noise terms; the same object if it has them already."""
        return self if same_terms(terms, self.terms) else self._fitted_with(terms)

    def _fitted_with(self, terms: Sequence[NoiseTerm]) -> NominalMisfit:
        table = self.table.with_noise(self.stated.plus(*terms))
        nominal = fit(self.simulation, (), table, self.fit.unknowns)
        patterns = _patterns(self.simulation, table, nominal)
        return replace(self, table=table, fit=nominal, patterns=patterns, terms=tuple(terms))

    @cached_property
    def shown(self) -> dict[str, Array]:
        """Columns of patterns and causes over the noise, by name."""
        return over(self.patterns, self.table) | {
            str(cause): signature for cause, signature in self.signatures.items()}

    @cached_property
    def tests(self) -> ResidualTests:
        """Tests of the residuals against all these columns."""
        return ResidualTests.of(self.fit.free_jacobian, self.shown,
                                float(self.table.noise.freedom.sum()), one_sided(self.causes))

    def _with_noise_of_channels(self) -> NominalMisfit:
        """Set the noise of each channel from its scatter, whether files state the noise or not.

        The scatter is that about all columns that may be shown. A channel with too few readings for
        that uses its own smooth misfits: neither a large misfit nor an outlier is noise. A noise
        that is given beside the readings counts too, unless the readings scatter far more.
        """
        factor, table, found = np.ones(len(self.table)), self.table, dict[str, float]()
        shown = self.shown
        for kind, rows in table.rows_of.items():
            rows, own, stated = self._channel(kind, rows, shown)
            if not own:
                continue
            columns = {name: values[rows] for name, values in shown.items()}
            single = {"single": np.eye(len(rows))} if len(rows) < _SINGLE else {}
            jacobian, residual = self.fit.free_jacobian[rows], self.fit.residual[rows]
            tests = ResidualTests.of(jacobian, columns | single, stated)
            if tests.freedom < _SHARE * len(rows):
                few = {name: columns[name] for name in own}
                tests = ResidualTests.of(jacobian, few | single, stated)
            if tests.freedom <= 0:
                continue
            # With lengths alone, the tests of all readings find their noise.
            if not table.lengths.all():
                factor[rows] = _factor(tests.noise(residual), tests.freedom + stated)
            # At places of a film, a misfit has a shape that no smooth curve here follows.
            placed = table.point[rows[0]] >= 0
            if stated and tests.freedom >= _KNOWN and not placed:
                found[kind] = replace(tests, stated=0.0).noise(residual)
                if found[kind] > UNLIKE:
                    factor[rows] = found[kind]
        if (factor == 1.0).all():
            return replace(self, scatter=found)
        table = table.with_noise(table.noise.times(factor))
        return replace(self, table=table, scatter=found,
                       fit=fit(self.simulation, (), table, self.fit.unknowns))

    def _channel(self, kind: str, rows: Numbers, shown: Mapping[str, Array]
                 ) -> tuple[Numbers, list[str], float]:
        """Find a channel's rows that determine its noise, its smooth misfits, its stated freedom.

        There are no misfits where the scatter does not determine the noise.
        """
        table, name = self.table, f"channel {kind}"
        if name in shown:
            return rows, [name], STATED if table.noise.given[rows].all() else 0.0
        resting = rows[~np.isin(table.state[rows], table.states.in_time)]
        if kind != "displacement" or not len(resting) or not table.noise.freedom.any():
            return rows, [], 0.0
        return resting, [name for name in self.patterns if name not in EACH_RUN], STATED


def one_sided(causes: Iterable[Cause]) -> frozenset[str]:
    """List the names of the causes whose size has only one sign."""
    return frozenset(str(cause) for cause in causes
                     if [parameter.sign for parameter in cause.effect.parameters] == ["positive"])


def with_noise_found(simulation: ReadingModel, table: ReadingTable, causes: Sequence[Cause]
                     ) -> ReadingTable:
    """Add the noise that the nominal model's misfit shows to a table."""
    misfit = NominalMisfit.of(simulation, table, causes)
    tests = misfit.tests
    if not tests.freedom + tests.stated:
        raise ArithmeticError(TOO_FEW)
    noise = misfit.table.noise.times(tests.noise(misfit.fit.residual))
    return misfit.table.with_noise(noise.known(tests.freedom + tests.stated))


def _patterns(simulation: ReadingModel, table: ReadingTable, nominal: Fit) -> dict[str, Array]:
    """Build patterns that a misfit may combine, in units of the readings."""
    names = [specimen.name for specimen in simulation.setup.specimens]
    predicted, columns = nominal.predicted(table), dict[str, Array]()
    for kind in simulation.evidence:
        if not (rows := rows_of_kinds([kind], table)).any():
            continue
        columns |= {name: among(rows, values) for name, values in kind.patterns(
            table[rows], names, predicted[rows]).items()}
    return columns


def _factor(scatter: float, freedom: float) -> float:
    """Compute the factor on a channel's noise from its scatter.

    It is below 1 only as far as the scatter excludes more noise: with a few degrees of freedom the
    scatter may be small by chance.
    """
    most = scatter * float((freedom / chdtri(freedom, _EXCLUDES)) ** 0.5)
    return max(min(most, max(scatter, 1.0)), _QUIETEST)
