"""Weights α of a shape, by membrane circles, cones and its fields, with their uncertainty."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.progress import Progress
from tympan.fem.film.library import MATERIALS
from tympan.fem.rig import Rig
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Specimen
from tympan.studies.alpha.circles import (
    RADII,
    Samples,
    concentric,
    cone_forces,
    equilibria,
    membrane_forces,
)
from tympan.studies.alpha.simplex import condition, simplex_fit, weight_ranges
from tympan.studies.case import Case, Settings, build_model
from tympan.studies.circles import radii_of
from tympan.studies.files import from_json, read_json, stored_file, to_json, write_json
from tympan.studies.limits.loads import LoadGrid, usual_masses, usual_voltages

Basis = Literal["membrane", "cone", "cone_scaled"]

#: Smallest and largest value of each weight.
Ranges = tuple[tuple[float, float], ...]

#: Largest number of circles: more cannot be distinguished.
MOST_CIRCLES = 6

#: Relative force error of a mixture of circles above which it does not represent the shape.
REPRESENTED = 0.01

#: Masses of the fit over the typical one, about as far apart as the source paper's two.
_FIT = (1.0, 1.25)
#: Masses of the test over the typical one: below, between and above those of the fit.
_HELD_OUT = (0.7, 1.1, 1.4)

#: Voltages of the fit over the typical one, equally spaced from zero.
_FIT_VOLTAGES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
#: Voltages of the test over the typical one: between those of the fit, and one beyond.
_HELD_OUT_VOLTAGES = (0.5, 0.9, 1.1)

#: Bases with the source paper's circles, which have no mixture for most shapes.
_CONES: dict[Basis, str] = {"cone": "cones as in Eq. (5)",
                            "cone_scaled": "cones scaled to the membrane"}
#: Relative force error of a mixture of cones at its bound above which a remark names it.
_UNFITTED = 0.02

#: Factor by which elements are finer in the test of the mesh's effect on α.
_FINER = 1.5


@dataclass(frozen=True)
class AlphaSettings:
    """Loads on which the weights are fitted and tested, and their circles.

    Loads left out follow from the film, see :meth:`loads`. ``radii`` is a key of
    :data:`tympan.studies.alpha.circles.RADII`. ``tolerance`` is the relative force error within
    which two mixtures count as equally good.
    """

    fit: LoadGrid | None = None
    held_out: LoadGrid | None = None
    circles: int = 2
    radii: str = "semi_axes"
    tolerance: float = 1e-3

    def __post_init__(self) -> None:
        """Refuse an invalid choice of circles."""
        if not 1 <= self.circles <= MOST_CIRCLES:
            raise InputError(f"must be from 1 to {MOST_CIRCLES}", key="circles", given=self.circles)
        if self.radii not in RADII:
            raise InputError(f"must be one of {', '.join(RADII)}", key="radii", given=self.radii)
        if not 0 < self.tolerance < 1:
            raise InputError("must be between 0 and 1", key="tolerance", given=self.tolerance)

    def loads(self, specimen: Specimen, settings: Settings, rig: Rig) -> AlphaLoads:
        """Choose the loads of a specimen.

        If none are given, the fit has two typical masses up to a typical voltage of the film; the
        test has others, from lighter to heavier, and voltages from between to beyond.
        """
        if self.fit is not None and self.held_out is not None:
            return AlphaLoads(self.fit, self.held_out)
        masses = usual_masses(specimen, settings, rig, (*_FIT, *_HELD_OUT))
        fitted, tested = masses[:len(_FIT)], masses[len(_FIT):]
        highest, = usual_voltages(specimen, max(masses), settings, rig, (1.0,))
        fit, held_out = (
            LoadGrid(chosen, tuple(round(share * highest, 6) for share in shares))
            for chosen, shares in ((fitted, _FIT_VOLTAGES), (tested, _HELD_OUT_VOLTAGES)))
        return AlphaLoads(self.fit or fit, self.held_out or held_out, from_film=True)


@dataclass(frozen=True)
class AlphaLoads:
    """Loads of fit and test of the weights; whether the film itself chose some of them."""

    fit: LoadGrid
    held_out: LoadGrid
    from_film: bool = False

    def greatest(self, specimen: Specimen, rig: Rig) -> Case:
        """Make the case of the largest mass and the highest voltage."""
        return Case.greatest(specimen, self.fit.masses + self.held_out.masses,
                             self.fit.voltages + self.held_out.voltages, rig)


@dataclass(frozen=True)
class Weights:
    """α by one method, with the relative root-mean-square error of the force.

    ``fit_error`` is that on the loads of the fit, ``held_out_error`` that on the others (None if no
    other load is in reach).
    """

    alpha: tuple[float, ...]
    fit_error: float
    held_out_error: float | None


@dataclass(frozen=True)
class AlphaResult:
    """α of a specimen for circles of the given radii [m], the shortest first.

    ``by_basis`` holds the fits against membrane circles, against cones as the paper writes them,
    and against cones whose force is multiplied by ``cone_scale``, the ratio of membrane to cone on
    the first circle. ``radii`` is the rule that chose the circles. ``ranges`` are those of each
    weight over all mixtures of membrane circles that are as good as the best, within the settings'
    tolerance of force; ``condition`` is that of the circles' relative differences. ``loads`` are
    those of fit and test. ``uncertainty`` is that of :func:`uncertainty`, if requested.
    """

    indexed: ClassVar[tuple[str, ...]] = ("radius_m",)

    specimen: str
    circles: tuple[float, ...]
    by_basis: dict[Basis, Weights]
    cone_scale: float
    from_fields: Weights
    field_range: Ranges
    warnings: tuple[str, ...]
    radii: str = "semi_axes"
    ranges: Ranges = ()
    condition: float = 1.0
    loads: AlphaLoads | None = None
    uncertainty: dict[str, Ranges | None] | None = None

    @property
    def rows(self) -> dict[str, Any]:
        """A row for each circle, of the fit against membrane circles."""
        weights = self.by_basis["membrane"]
        return {"radius_m": self.circles} | asdict(weights)

    def json(self, basis: Basis = "membrane") -> dict[str, Any]:
        """Write the object of ``alpha --json`` for one basis."""
        plain = to_json(self)
        weights = plain["by_basis"][basis]
        return {
            "specimen": self.specimen, "circles": plain["circles"],
            "alpha": weights["alpha"], "basis": basis, **weights,
            "from_fields": {**plain["from_fields"], "range": plain["field_range"]},
            **{name: plain[name]
               for name in ("cone_scale", "radii", "ranges", "condition", "loads")},
            "warnings": [*self.warnings, *self._doubts_of(basis)],
            **({} if self.uncertainty is None else {"uncertainty": plain["uncertainty"]})}

    def _doubts_of(self, basis: Basis) -> list[str]:
        """Warn that no mixture of one basis' circles has the force."""
        weights = self.by_basis[basis]
        if (basis not in _CONES or len(self.circles) == 1 or min(weights.alpha) > 0
                or weights.fit_error <= _UNFITTED):
            return []
        return [f"{_CONES[basis]}: no mixture fits, α sits at its bound and leaves a force error "
                f"of {100 * weights.fit_error:.0f} %"]

    def record(self) -> dict[str, Any]:
        """Write all bases, as stored."""
        return self.json() | {"bases": to_json(self.by_basis)}

    @classmethod
    def of_record(cls, record: Any, file: Path | str | None = None, key: str = "") -> AlphaResult:
        """Read the weights of a record that :meth:`record` made."""
        stored = from_json(dict[str, Any], record, file, key)
        ranges = from_json(dict[str, Any], stored.get("from_fields"), file,
                           f"{key}.from_fields").get("range")
        bases = from_json(dict[Basis, Weights], stored.get("bases"), file, f"{key}.bases")
        result = from_json(cls, {**stored, "by_basis": to_json(bases), "field_range": ranges},
                           file, key)
        # Earlier versions stored the remarks on every basis.
        result = replace(result, warnings=tuple(
            text for text in result.warnings if not text.startswith(tuple(_CONES.values()))))
        for weights in (*result.by_basis.values(), result.from_fields):
            if len(weights.alpha) != len(result.circles):
                raise InputError(f"must have as many α as circles, {len(result.circles)}",
                                 file=file, key=key or None, given=list(weights.alpha))
        return result

    def save(self, folder: Path) -> None:
        """Write ``NAME-alpha.json``; NAME is the specimen's."""
        write_json(folder / f"{self.specimen}-alpha.json", self.record())

    @classmethod
    def load(cls, folder: Path, name: str | None = None) -> AlphaResult:
        """Load saved weights, by the specimen's ``name``, or the only ones."""
        file = stored_file(folder, "*-alpha.json", name, "tympan alpha")
        return cls.of_record(read_json(file), file)


def alpha(specimen: Specimen, settings: Settings, alpha_settings: AlphaSettings = AlphaSettings(),
          rig: Rig = Rig(), progress: Progress = lambda _: None,
          radii: tuple[float, ...] | None = None
          ) -> AlphaResult:
    """Find the weights of the circles that are equivalent to a shape.

    Three fits of Σ α_j F_j(y, U) to the specimen's own force at its equilibria are made, all with α
    ≥ 0 and Σ α = 1: with F_j of membrane circles by the same finite elements, of straight cones
    (Eq. 5), and of cones scaled to the membrane on the first circle. Independently, the fields give
    the share of the plate's vertical edge force carried where the frame is nearest, next nearest,
    …, in as many parts of the full angle as there are circles, averaged over the fit's loads (for
    two, the sectors within 45° of an ellipse's short and of its long axis).

    A circle with its plate in the middle is one circle, α = (1). A frame with equal semi-axes that
    is no circle gets circles by sectors where semi-axes are wanted. ``radii`` [m] are those of the
    circles, the shortest first, if they are known already.

    Raises
    ------
    InputError
        When no load of the fit has an equilibrium.
    """
    specimen.needed_plate()
    model = build_model(specimen, settings, rig.loading)
    count, how = (_circles(specimen, alpha_settings) if radii is None
                  else (len(radii), alpha_settings.radii))
    warnings: list[str] = []
    progress(f"{specimen.name}: equilibria")
    loads = alpha_settings.loads(specimen, settings, rig)
    greatest = loads.greatest(specimen, rig)
    settings = settings.bounded(model, (1 + count) * (loads.fit.count + loads.held_out.count))
    fit = equilibria(model, loads.fit, rig, settings, count, warnings)
    test = equilibria(model, loads.held_out, rig, settings, count, warnings)
    settings.path.require_work(specimen.name)
    if not len(fit):
        raise InputError(greatest.doubted("has no equilibrium at any load of the fit"),
                         key="alpha", given=specimen.name)
    progress(f"{specimen.name}: circles")
    forces = partial(membrane_forces, specimen, settings, rig)
    radii = RADII[how](specimen, count, forces, fit) if radii is None else radii
    membrane = [forces(radii, samples) for samples in (fit, test)]
    cone = [cone_forces(specimen, radii, samples) for samples in (fit, test)]
    first_film, first_cone = membrane[0][:, 0], cone[0][:, 0]
    scale = float(first_film @ first_cone / (first_cone @ first_cone))
    bases: dict[Basis, list[Array]] = {
        "membrane": membrane, "cone": cone, "cone_scaled": [scale * part for part in cone]}
    by_basis = {name: _weigh(simplex_fit(parts[0], fit.force), parts, fit, test)
                for name, parts in bases.items()}
    shares = fit.shares.mean(axis=0)
    lows, highs = fit.shares.min(0).tolist(), fit.shares.max(0).tolist()
    spread = tuple(zip(lows, highs, strict=True))
    fitted_force = membrane[0] @ by_basis["membrane"].alpha
    best = np.abs(fitted_force / fit.force - 1).max()
    ranges = weight_ranges(membrane[0], fit.force, best + alpha_settings.tolerance)
    result = AlphaResult(specimen.name, radii, by_basis, scale, _weigh(shares, membrane, fit, test),
                         spread, tuple(warnings), how, ranges, condition(membrane[0]), loads)
    return replace(result, warnings=(*warnings, *_doubts(specimen, result, alpha_settings),
                                     *greatest.remarks))


def uncertainty(specimen: Specimen, settings: Settings, alpha_settings: AlphaSettings, rig: Rig,
                nominal: AlphaResult, progress: Progress = lambda _: None
                ) -> dict[str, Ranges | None]:
    """Find the range of each weight of ``nominal``'s membrane circles under changes, by their kind.

    ``mesh``: elements finer by 1.5. ``material``: each material of the library in place of the
    film's, except those whose range does not include its prestretch. ``loads``: each mass of the
    fit alone, and the lower and upper half of its voltages. A kind is None if nothing could be
    changed; a change without an equilibrium to fit is left out.
    """
    film, loads = specimen.membrane, nominal.loads or alpha_settings.loads(specimen, settings, rig)
    fit = loads.fit
    alpha_settings = replace(alpha_settings, fit=fit, held_out=loads.held_out)
    half, voltages = len(fit.voltages) // 2, tuple(sorted(fit.voltages))
    grids = {f"{mass * 1e3:g} g alone": LoadGrid((mass,), fit.voltages)
             for mass in fit.masses if len(fit.masses) > 1}
    if half:
        grids |= {"lower voltages": LoadGrid(fit.masses, voltages[:half]),
                  "higher voltages": LoadGrid(fit.masses, voltages[half:])}
    finer = replace(settings, mesh=settings.mesh.refined(_FINER))
    changes: dict[str, Iterable[tuple[str, Specimen, Settings, AlphaSettings]]] = {
        "mesh": [("a finer mesh", specimen, finer, alpha_settings)],
        "material": [(name, replace(specimen, membrane=replace(film, material=entry.material)),
                      settings, alpha_settings)
                     for name, entry in MATERIALS.items()
                     if entry.material != film.material and entry.holds(film.prestretch)],
        "loads": [(name, specimen, settings, replace(alpha_settings, fit=grid))
                  for name, grid in grids.items()]}
    ranges: dict[str, Ranges | None] = {}
    for kind, cases in changes.items():
        weights = [nominal.by_basis["membrane"].alpha]
        for name, changed, mesh, chosen in cases:
            progress(f"{specimen.name}: α with {name}")
            try:
                result = alpha(changed, mesh, chosen, rig, radii=nominal.circles)
            except InputError:
                continue
            weights.append(result.by_basis["membrane"].alpha)
        columns = zip(*weights, strict=True)
        ranges[kind] = (tuple((min(column), max(column)) for column in columns)
                        if len(weights) > 1 else None)
    return ranges


def _circles(specimen: Specimen, chosen: AlphaSettings) -> tuple[int, str]:
    """Choose the number of circles, and the rule for their radii."""
    if concentric(specimen):
        return 1, "semi_axes"
    if chosen.radii != "semi_axes" or len(radii_of(specimen.frame)) > 1:
        return chosen.circles, chosen.radii
    return (1, "semi_axes") if isinstance(specimen.frame, Circle) else (chosen.circles, "sectors")


def _weigh(weights: Array, forces: Iterable[Array], fit: Samples, test: Samples) -> Weights:
    fit_error, test_error = (
        float(np.linalg.norm(part @ weights - samples.force) / np.linalg.norm(samples.force))
        if len(samples) else None for part, samples in zip(forces, (fit, test), strict=True))
    assert fit_error is not None
    return Weights(tuple(float(weight) for weight in weights), fit_error, test_error)


def _doubts(specimen: Specimen, result: AlphaResult, chosen: AlphaSettings) -> list[str]:
    """List doubts that a user of these weights must know."""
    membrane, radii = result.by_basis["membrane"], result.circles
    round_plate = isinstance(specimen.needed_plate().outline, Circle)
    if len(radii) == 1 and round_plate and concentric(specimen):
        return ["the semi-axes are equal: the shape is one circle and α is 1"]
    doubts = []
    error = f"{100 * membrane.fit_error:.1f} %"
    if len(radii) == 1 and isinstance(specimen.frame, Circle):
        doubts.append("the frame is one circle and α is 1, but the plate is not a circle in its "
                      f"middle: the force is {error} off")
    elif membrane.fit_error > REPRESENTED:
        sizes = ", ".join(f"{radius * 1e3:.4g}" for radius in radii)
        doubts.append(f"no mixture of circles of {sizes} mm represents this shape: the best leaves "
                      f"a force error of {error}"
                      + ("" if result.radii == "fit" else "; radii by fit may"))
    if result.radii != chosen.radii and len(radii) > 1:
        doubts.append("the semi-axes are equal but the frame is no circle: the circles' radii are "
                      "those of sectors")
    wide = [str(number) for number, (low, high) in enumerate(result.ranges, start=1)
            if high - low > 0.2]
    if wide:
        doubts.append(f"these loads do not determine α{', α'.join(wide)}: over ranges of more than "
                      f"0.2 the force stays within {100 * chosen.tolerance:g} % of the best "
                      "mixture's")
    return doubts
