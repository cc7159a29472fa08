"""Mechanisms between plate and ground: springs, constant forces, magnets, buckled beams, tables.

Another film joined by a rod is also a mechanism. Each computes its energy from the deflection of
the plate. A rig may have any number of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from math import factorial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Protocol, Self

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.base.fields import Content, Key, Registry, read
from tympan.base.toml_reader import NON_NEGATIVE, POSITIVE, Rule, Table
from tympan.base.units import LEAST_STEP, quantities_text
from tympan.fem.complex_step import complex_step
from tympan.fem.film.library import load_specimen
from tympan.fem.membrane.quintics import QuinticCurve
from tympan.geometry.specimen import Specimen

_POWER: Rule = (lambda x: 1 < x <= 12, "must be above 1 and at most 12")
_COUNT: Rule = (lambda x: 1 <= x <= 1000, "must be a whole number from 1 to 1000")

#: Largest compression of a beam, as a share of its length: beyond, its slopes are not small.
_MOST_COMPRESSED = 0.05
#: Largest thickness of a beam over its length: there, shear adds some 12 % to the deflection of
#: each half, 12.5 times the square of this share for a Poisson's ratio of 0.3.
_THICKEST = 0.1
#: Terms of the series about a beam without axial force: at π² the last is below 1e-16 of the sum.
_TERMS = 26
#: Square of a half beam's phase at which it buckles alone, with its ends at rest.
_SECOND_BUCKLING = float(np.pi**2)
#: Square of the phase, far in tension, below which closed forms lose no digits.
_TENSE = -10.0
#: Largest distance that a rod may hold the other plate out, in half extents of its frame.
_MOST_HELD = 1.5
#: Most corrections of the axial force, which rarely needs ten.
_CORRECTIONS = 200


#: Two deflections [m], the first below the second; they may be infinite.
Interval = tuple[float, float]


class Bias(Protocol):
    """A mechanism between plate and ground; its energy depends on the deflection alone.

    Its stiffness does not jump. The slope of the stiffness may jump at the deflections [m] that a
    property ``kinks`` lists; interpolating curves begin anew there.
    """

    law: ClassVar[str]

    @property
    def softening(self) -> tuple[Interval, ...]:
        """Deflections [m] between which its stiffness may be negative; elsewhere it never is.

        A plate can snap only there.
        """

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        """Compute energy [J], its derivative [N] (positive: pushes back), and stiffness [N/m].

        They are nan where the mechanism cannot be. It takes arrays where the class has ``on_arrays
        = True``.
        """


def acting(biases: Sequence[Bias], deflections: AnyArray) -> AnyArray:
    """Sum energy [J] of mechanisms, its derivative [N] and its second derivative [N/m], (3, …).

    The deflections [m] have any shape; values are nan where one of the mechanisms cannot be.
    """
    total = np.zeros((3, *deflections.shape), dtype=deflections.dtype)
    found: Any
    law: Any
    for bias in biases:
        law = bias
        if getattr(bias, "on_arrays", False):
            found = law.derivatives(deflections)
        elif deflections.size <= _ONE_BY_ONE or np.iscomplexobj(deflections):
            found = np.reshape([bias.derivatives(place) for place in deflections.ravel().tolist()],
                               (*deflections.shape, 3)).transpose(-1, *range(deflections.ndim))
        else:
            far = np.abs(deflections[np.abs(deflections) < _FAR]).max(initial=_REACH)
            curve = _curve(law, float(_REACH * 2 ** np.ceil(np.log2(far / _REACH))))
            found = [np.nan] * 3 if curve is None else curve.derivatives(deflections)
        for number, part in enumerate(found):
            total[number] += part
    return total


@lru_cache(maxsize=32)
def _curve(bias: Any, reach: float) -> QuinticCurve | None:
    """Interpolate a law that takes one deflection up to a reach [m]; None where it never exists.

    The curve is kept, since a search evaluates its force in many steps.
    """
    return QuinticCurve.of(bias.derivatives, -reach, reach, getattr(bias, "kinks", ()))


#: Number of places up to which a law that takes one number is evaluated at each.
_ONE_BY_ONE = 64
#: Smallest reach of a curve on arrays [m]; larger ones are doubled from it.
_REACH = 5e-3
#: Largest reach of a curve [m].
_FAR = 1.0

#: Bias mechanisms that rig files may name.
BIASES: Registry[Any] = Registry("law")


@BIASES.register
@dataclass(frozen=True)
class Spring:
    """A linear spring."""

    law: ClassVar[str] = "spring"
    on_arrays: ClassVar[bool] = True
    softening: ClassVar[tuple[Interval, ...]] = ()
    stiffness: Annotated[float, Key("its stiffness", "stiffness per length", NON_NEGATIVE)]
    rest: Annotated[float, Key("deflection at which it is unloaded", "length")] = 0.0
    preload: Annotated[float, Key(
        "in place of `rest`: the force along the deflection with which it pulls the plate at "
        "deflection 0", "force")] = 0.0

    def __post_init__(self) -> None:
        if np.real(self.rest) and np.real(self.preload):
            raise InputError("must be left out where `rest` is given: both say where the spring is "
                             "unloaded", key="preload", given=f"{self.preload:g} N")

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        stretch = deflection - self.rest
        return (self.stiffness * stretch**2 / 2 - self.preload * deflection,
                self.stiffness * stretch - self.preload, self.stiffness)


@BIASES.register
@dataclass(frozen=True)
class Constant:
    """A constant force, such as that of a weight on a string over a pulley."""

    law: ClassVar[str] = "constant"
    on_arrays: ClassVar[bool] = True
    softening: ClassVar[tuple[Interval, ...]] = ()
    force: Annotated[float, Key("positive along the deflection", "force")]

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        return -self.force * deflection, -self.force, 0.0


@BIASES.register
@dataclass(frozen=True)
class Magnet:
    """A magnet below the plate that pulls with F = F₀ (1 + g/d)^(−n) over the gap g = gap − w.

    Far away the pull of two dipoles falls with n = 4. The plate's negative stiffness makes the
    actuator snap through.
    """

    law: ClassVar[str] = "magnet"
    on_arrays: ClassVar[bool] = True
    force: Annotated[float, Key("F₀: its pull at contact", "force", POSITIVE)]
    gap: Annotated[float, Key("gap between magnet and plate of the flat film", "length", POSITIVE)]
    decay: Annotated[float, Key("d: length in which the pull falls, F₀ (1 + gap/d)^(−n)", "length",
                                POSITIVE)]
    power: Annotated[float, Key("n: how steeply it falls far away", rule=_POWER)] = 4.0

    @property
    def softening(self) -> tuple[Interval, ...]:
        return (-np.inf, float(np.real(self.gap))),

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        # The energy is −F₀ d/(n−1) (1 + g/d)^(1−n).
        n, d = self.power, self.decay
        near: Any = 1 + (self.gap - deflection) / d
        # No step may end at or beyond the pole.
        near = np.where(np.real(near) > 0, near, np.nan)[()]
        energy = -self.force * d / (n - 1) * near ** (1 - n)
        push = -self.force * near**-n
        stiffness = -self.force * n / d * near ** (-n - 1)
        return energy, push, stiffness


@BIASES.register
@dataclass(frozen=True)
class Bistable:
    """A mechanism with two rest positions, as a data sheet describes it: a cubic force.

    Between the rest positions the force has a largest and a least value, at about a fifth and four
    fifths of the travel. With equal forces f it is 12 √3 f s (s − 1/2) (s − 1), s the share of the
    travel.
    """

    law: ClassVar[str] = "bistable"
    on_arrays: ClassVar[bool] = True
    force: Annotated[float, Key("largest force that it takes to push it over", "force", POSITIVE)]
    travel: Annotated[float, Key("between its two rest positions", "length", POSITIVE)]
    back: Annotated[float, Key("largest force that it takes to push it back; left out, as much as "
                               "over", "force", NON_NEGATIVE)] = 0.0
    rest: Annotated[float, Key("deflection at the first rest position", "length")] = 0.0

    @cached_property
    def _shape(self) -> tuple[Any, Any]:
        """Unstable position between the rest positions, over the travel, and the cubic's factor."""
        ratio: Any = (self.back if np.real(self.back) else self.force) / self.force
        low, high = 0.0, 1.0
        while high - low > 1e-15:
            middle = (low + high) / 2
            over, back = _peaks(middle)
            # The plate is easier to push over if the unstable position is nearer to the first.
            low, high = (middle, high) if back > np.real(ratio) * over else (low, middle)
        place: Any = low
        if np.iscomplexobj(ratio):  # derivative of the implicit function, off the real axis
            slope = complex_step(lambda at: _peaks(at)[1] - np.real(ratio) * _peaks(at)[0], low)
            place = low + 1j * np.imag(ratio) * _peaks(low)[0] / slope
        return place, self.force / _peaks(place)[0]

    @property
    def softening(self) -> tuple[Interval, ...]:
        low, high = (float(np.real(self.rest + at * self.travel))
                     for at in _turns(np.real(self._shape[0])))
        return (low, high),

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        middle, factor = self._shape
        s = (deflection - self.rest) / self.travel
        energy = factor * self.travel * s * s * (middle / 2 + s * (s / 4 - (1 + middle) / 3))
        push = factor * s * (s - middle) * (s - 1)
        stiffness = factor / self.travel * (middle + s * (3 * s - 2 * (1 + middle)))
        return energy, push, stiffness


def _peaks(middle: Any) -> tuple[Any, Any]:
    """Compute the largest and minus the least value of s (s − middle) (s − 1) between 0 and 1."""
    over, back = (s * (s - middle) * (s - 1) for s in _turns(middle))
    return over, -back


def _turns(middle: Any) -> tuple[Any, Any]:
    """Find both extrema of s (s − middle) (s − 1)."""
    half = (1 + middle) / 3
    root = (half**2 - middle / 3) ** 0.5
    return half - root, half + root


@BIASES.register
@dataclass(frozen=True)
class BuckledBeam:
    """Straight beams, clamped at both ends and pushed together, whose middle the plate carries.

    Each half is a beam column that is clamped at one end and guided at the other, exactly but for
    slopes beyond small ones: shear, axial compression and bending are in balance under an axial
    force P that follows from the given compression. P stays where a half buckles by itself. The
    middle must not turn, and a compression above 5 % of the length is refused.

    Timoshenko and Gere, Theory of Elastic Stability (1961), chapter 1, for the beam column.
    """

    law: ClassVar[str] = "buckled_beam"
    length: Annotated[float, Key("between the clamps, before the beam is compressed", "length",
                                 POSITIVE)]
    width: Annotated[float, Key("of one beam", "length", POSITIVE)]
    thickness: Annotated[float, Key("of one beam, along the deflection", "length", POSITIVE)]
    modulus: Annotated[float, Key("Young's modulus", "stress", POSITIVE)]
    compression: Annotated[float, Key("by which the clamps are pushed together", "length",
                                      NON_NEGATIVE)]
    number: Annotated[int, Key("of beams side by side", rule=_COUNT)] = 1
    middle: Annotated[float, Key("deflection at which the beams are straight", "length")] = 0.0

    def __post_init__(self) -> None:
        if np.real(self.thickness) > _THICKEST * np.real(self.length):
            raise InputError("must be at most a tenth of the length: a thicker beam also shears, "
                             "which is not modelled", key="thickness",
                             given=f"{1e3 * self.thickness:g} mm of {1e3 * self.length:g} mm")
        if np.real(self.compression) > _MOST_COMPRESSED * np.real(self.length):
            raise InputError("must be at most 5 % of the length: further the beam's slopes are not "
                             "small", key="compression", given=f"{1e3 * self.compression:g} mm of "
                                                               f"{1e3 * self.length:g} mm")

    @property
    def softening(self) -> tuple[Interval, ...]:
        if not np.real(self.derivatives(self.middle)[2]) < 0:
            return ()
        # Without axial force a half beam shortens by 0.6 of the square; further out beams are in
        # tension.
        most = float(np.real((self.compression * self.length / 2.4) ** 0.5))
        middle = float(np.real(self.middle))
        return (middle - most, middle + most),

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        moved = deflection - self.middle
        half = self.length / 2
        # x is the square of a half's phase: P = 4 EI x/half², under which it yields by yielding x.
        yielding = self.thickness**2 / (3 * half)
        bending = self.number * 2 * self.modulus * self.width * self.thickness**3 / 12
        shear = bending * 4 / half**3
        x, held = self._phase(moved, yielding, half)
        v, v_x, g, g_x = _beam_column(x)
        push = shear * v * moved
        if held:
            stiffness = shear * v
        else:
            turn = -2 * g * moved / half / (yielding + g_x * moved**2 / half)
            stiffness = shear * (v + v_x * moved * turn)
        # Bending has V w/2 + P s, s the shortening; the axial force has half of P times its own.
        axial = shear * half * x
        bent = self.compression / 2 - yielding * x
        return push * moved / 2 + axial * (bent + yielding * x / 2), push, stiffness

    def _phase(self, moved: Any, yielding: Any, half: Any) -> tuple[Any, bool]:
        """Find the square of a half's phase, and whether that is where it buckles alone."""
        def missing(x: Any, at: Any, ease: Any, long: Any, given: Any) -> tuple[Any, Any]:
            _, _, g, g_x = _beam_column(x)
            return ease * x + g * at**2 / long - given / 2, ease + g_x * at**2 / long

        every = moved, yielding, half, self.compression
        reals = tuple(float(np.real(number)) for number in every)
        real, ease, long, given = reals
        if missing(_SECOND_BUCKLING, *reals)[0] <= 0:
            return _SECOND_BUCKLING, True
        # In tension a half shortens by at least half of the square, without tension by 0.6 of it.
        high = _SECOND_BUCKLING
        low = min((given / 2 - 0.75 * real**2 / long) / ease, high) - 1.0
        x = min(max((given / 2 - 0.6 * real**2 / long) / ease, low), high)
        for _ in range(_CORRECTIONS):
            value, slope = missing(x, *reals)
            low, high = (x, high) if value < 0 else (low, x)
            step = x - value / slope
            step = step if low < step < high else (low + high) / 2
            if abs(step - x) <= 1e-15 * max(abs(x), 1.0):
                break
            x = step
        if any(map(np.iscomplexobj, every)):  # derivative by a step off the real axis
            value, slope = missing(x, *every)
            return x - 1j * np.imag(value / slope), False
        return x, False


def _beam_column(x: Any) -> tuple[Any, Any, Any, Any]:
    """Compute shear v, shortening g of a beam column by the square of its phase, with slopes.

    The beam is clamped at 0, guided at l and moved by w there, under P = 4 EI x/l²: the shear force
    is 4 EI/l³ v w, and it shortens by g w²/l. With h² = x, c = cos h, s = sin h: v = h² c/(s/h −
    c), g = (1 − 3 s c/h + 2 c²)/(4 (s/h − c)²). Near x = 0, (s/h − c)/x and the other bracket over
    x² are computed by series.
    """
    if np.real(x) >= _TENSE:
        e, e_x = _series(_SHEAR, x)
        m, m_x = _series(_SHORTENING, x)
        c, c_x = _series(_COSINE, x)
        v = c / e
        v_x = (c_x - v * e_x) / e
        g = m / (4 * e**2)
        g_x = m_x / (4 * e**2) - 2 * g * e_x / e
        return v, v_x, g, g_x
    # All terms are over cosh y, y² = −x, which may be large.
    y = np.sqrt(-x)
    tangent = np.tanh(y) / y
    square = 1 / np.cosh(np.where(np.real(y) > 300, 300, y)) ** 2
    e = tangent - 1
    e_x = (tangent - square) / (2 * -x)
    v = x / e
    v_x = 1 / e - v * e_x / e
    g = (square - 3 * tangent + 2) / (4 * e**2)
    square_x = square * tangent
    g_x = (square_x - 3 * e_x) / (4 * e**2) - 2 * g * e_x / e
    return v, v_x, g, g_x


_ORDERS = range(_TERMS)
#: Coefficients of cos √x.
_COSINE = [(-1) ** k / factorial(2 * k) for k in _ORDERS]
#: Coefficients of (sin √x/√x − cos √x)/x.
_SHEAR = [(-1) ** k * 2 * (k + 1) / factorial(2 * k + 3) for k in _ORDERS]
#: Coefficients of (1 − 3 sin √x cos √x/√x + 2 cos² √x)/x².
_SHORTENING = [(-1) ** k * 4 ** (k + 2) * 2 * (k + 1) / factorial(2 * k + 5) for k in _ORDERS]


def _series(coefficients: list[float], x: Any) -> tuple[Any, Any]:
    """Evaluate a power series and its derivative."""
    value, slope = 0.0 * x, 0.0 * x
    for coefficient in reversed(coefficients):
        slope = slope * x + value
        value = value * x + coefficient
    return value, slope


@BIASES.register
@dataclass(frozen=True)
class ForceTable:
    """A mechanism that was measured: its force at some deflections, and between them smoothly.

    Cubics with a continuous slope that rise and fall only where the readings do (Fritsch and
    Carlson, SIAM Journal on Numerical Analysis 17, 238, 1980). Beyond the table it cannot be. The
    numbers of a ``file`` are read once and kept.
    """

    law: ClassVar[str] = "table"
    on_arrays: ClassVar[bool] = True
    displacement: Annotated[tuple[float, ...], Key(
        "deflections of the plate, one larger than the other", "length", least=2, discrete=True,
        default="those of `file`")]
    force: Annotated[tuple[float, ...], Key(
        "force at each of them, positive where it pushes back as a spring does", "force", least=2,
        discrete=True, default="those of `file`")]
    file: Annotated[str | None, Key("in place of both lists: the CSV file or workbook that has "
                                    "them, from the folder of this file")] = None
    columns: Annotated[tuple[str, str] | None, Key(
        "names of its columns of displacement and force, which end in their units; others are left "
        "aside", needs="file", default="displacement and force in any unit, and no others")] = None

    @classmethod
    def from_table(cls, table: Table) -> Self:
        """Read from a table of a rig file; its ``file`` is relative to that file's folder."""
        return read(cls, table, {(cls, "file"): _file_beside, (cls, "columns"): _titles})

    @classmethod
    def completed(cls, given: Content) -> Content:
        """Add the numbers of the file, if one is given."""
        file, titles = given.get("file"), given.get("columns")
        if file is None:
            if titles:
                raise InputError("must be left out where there is no `file`", key="columns",
                                 given=", ".join(titles))
            return given
        for name in ("displacement", "force"):
            if name in given:
                raise InputError("must be left out where `file` is given", key=name)
        from tympan.fem.membrane.force_files import measured  # readers of tables are slow to load

        displacement, force = measured(Path(file), titles)
        return {"displacement": displacement, "force": force}

    def __post_init__(self) -> None:
        if len(self.force) != len(self.displacement):
            raise InputError(f"must have as many numbers as `displacement`, "
                             f"{len(self.displacement)}", key="force", given=len(self.force))
        if not np.all(np.diff(self.displacement) >= LEAST_STEP):
            raise InputError("must grow from one number to the next, by 1 nm at least: a table has "
                             "one force at each deflection", key="displacement",
                             given=quantities_text(self.displacement, "length"))

    @property
    def softening(self) -> tuple[Interval, ...]:
        places, forces = np.real(self.displacement).tolist(), np.real(self.force).tolist()
        points = zip(places, forces, strict=True)
        return tuple((low, high) for (low, before), (high, after) in pairwise(points)
                     if after < before)

    @property
    def kinks(self) -> tuple[float, ...]:
        """Deflections [m] between which force and stiffness are smooth; neither jumps there."""
        return tuple(np.real(self.displacement).tolist())

    @cached_property
    def _cubics(self) -> tuple[AnyArray, AnyArray, AnyArray]:
        """Breaks, coefficients of the force (4, pieces) and the energy up to each break."""
        from scipy.interpolate import PchipInterpolator

        curve = PchipInterpolator(self.displacement, self.force)
        stored = curve.antiderivative()(curve.x)
        return curve.x, curve.c, stored - np.interp(0.0, curve.x, stored)

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        breaks, cubics, stored = self._cubics
        at = np.real(deflection)
        k = np.clip(np.searchsorted(breaks, at, "right") - 1, 0, len(breaks) - 2)
        # The mechanism cannot be beyond the table.
        within = (at >= breaks[0]) & (at <= breaks[-1])
        u = deflection - np.where(within, breaks[k], np.nan)[()]
        a, b, c, d = cubics[:, k]
        energy = stored[k] + u * (d + u * (c / 2 + u * (b / 3 + u * a / 4)))
        push = d + u * (c + u * (b + u * a))
        stiffness = c + u * (2 * b + u * 3 * a)
        return energy, push, stiffness


def _file_beside(table: Table, key: str) -> str | None:
    """Locate the file that a key names, relative to the table's own file; None without the key."""
    named = table.value(key, None)
    return None if named is None else str(table.beside(key))


def _titles(table: Table, key: str) -> tuple[str, ...] | None:
    """Read the names of two columns; None without the key."""
    names = table.value(key, None)
    if names is None:
        return None
    if (not isinstance(names, list) or len(names) != 2
            or not all(isinstance(name, str) for name in names)):
        raise table.error(key, 'must be two names of columns, such as ["displacement_mm", '
                               '"force_N"]', names)
    return tuple(names)


@BIASES.register
@dataclass(frozen=True)
class JoinedFilm:
    """Another film, whose plate a rod joins to this plate: an antagonist, or half a double cone.

    Both frames are parallel and above each other, `distance` apart. The rod goes from plate to
    plate through both centres. As long as the distance it leaves both films flat; a longer one
    pushes the plates apart, a shorter one pulls them together. Its ends are joints: each plate
    tilts by itself. Once solved on a mesh, the film follows without inertia, its branches relaxed.
    """

    law: ClassVar[str] = "film"
    #: A taut film pushes back the more, the further it is out, so no snap is sought.
    softening: ClassVar[tuple[Interval, ...]] = ()
    specimen: Annotated[Specimen, Key(
        "the other film: its specimen file, from the folder of this file, or its table",
        discrete=True)]
    distance: Annotated[float, Key("between the planes of the two frames", "length", NON_NEGATIVE)]
    rod: Annotated[float, Key("length of the rod from plate to plate", "length", NON_NEGATIVE)]
    voltage: Annotated[float, Key("across the other film itself, which stays as it is", "voltage",
                                  NON_NEGATIVE)] = 0.0
    side: Annotated[Literal["below", "above"], Key(
        "where the other frame is: below is where deflections go")] = "below"

    def __post_init__(self) -> None:
        self.specimen.needed_plate()
        most = _MOST_HELD * max(self.specimen.frame.semi_axes)
        out = float(np.real(self.other(0.0)))
        if not abs(out) <= most:
            low, high = (1e3 * max(float(np.real(self.distance)) + way * most, 0.0)
                         for way in (-1, 1))
            raise InputError(
                f"must be from {low:.4g} to {high:.4g} mm: with this plate at 0 mm the other "
                f"one would be at {1e3 * out:.4g} mm, further than {_MOST_HELD:g} times its "
                "frame's half extent", key="rod", given=f"{1e3 * np.real(self.rod):.4g} mm")

    @classmethod
    def from_table(cls, table: Table) -> Self:
        """Read from a table of a rig file; its specimen is relative to that file's folder."""
        return read(cls, table, {(cls, "specimen"): _specimen_beside})

    def other(self, deflection: Any) -> Any:
        """Compute the deflection of the other plate [m] from that of this one."""
        longer = self.rod - self.distance
        return deflection + (longer if self.side == "below" else -longer)

    def derivatives(self, deflection: float) -> tuple[float, float, float]:
        """Refuse: a model replaces this by the film that is solved on a mesh."""
        raise TypeError("a joined film has no force before it is solved on a mesh")


def _specimen_beside(table: Table, key: str) -> Specimen:
    """Read the specimen of a file in the table's own folder, or of a table."""
    table.value(key)  # which must be there
    table = table.table_or_file(key)
    if "rig" in table:
        raise table.error("rig", "must be left out: what acts on a joined film is the rig that "
                                 "joins it")
    return load_specimen(table)
