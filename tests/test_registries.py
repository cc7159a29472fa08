"""A law, outline, effect, bias mechanism and rig key, each declared here and nowhere else.

Each is read, written, listed, differentiated and documented without another line changed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import pytest

from tests.support.specimens import circular, specimen_toml
from tympan.base.errors import InputError
from tympan.base.fields import Key, Registry
from tympan.base.paths import with_change
from tympan.base.toml_reader import NON_NEGATIVE, POSITIVE, Rule
from tympan.cli import main
from tympan.fem.film.laws import LAWS
from tympan.fem.film.laws.invariants import FirstInvariantLaw
from tympan.fem.film.library import load_specimen
from tympan.fem.membrane.biases import BIASES
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import rig_to_toml, specimen_to_toml
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import OUTLINES, Ellipse, Outline
from tympan.geometry.outlines.pieces import Arc, Piece
from tympan.geometry.specimen import Specimen
from tympan.reports import reference
from tympan.studies.case import Case, Settings, solve
from tympan.studies.data.dataset import FILES
from tympan.studies.diagnosis.evidence.coupons import CouponTests
from tympan.studies.diagnosis.evidence.registry import PLATES
from tympan.studies.diagnosis.reading_table import UNITS
from tympan.studies.effects import EFFECTS, EffectParameter, Setup, listing
from tympan.studies.effects.effect import effect
from tympan.studies.sensitivity import sensitivity
from tympan.studies.signals import WAVES, Wave

MASS, VOLTAGE = 17.9e-3, 3e3
COARSE = Settings(MeshSettings(order=2).refined(0.5))
_FLATNESS: Rule = (lambda x: 0.2 <= x <= 5, "must be from 0.2 to 5")


@pytest.fixture(autouse=True, scope="module")
def registered() -> Iterator[None]:
    """The kinds below, and the registries as they were."""
    before = [(kinds, dict(kinds)) for kinds in (LAWS, OUTLINES, BIASES, EFFECTS)]
    LAWS.register(Dummy)
    OUTLINES.register(Squashed)
    BIASES.register(Cubic)
    effect("The plate has a tail.", finding="The plate has a tail of {weight}",
           check="look at the plate")(tail)
    yield
    for kinds, items in before:
        kinds.clear()
        kinds.update(items)


@dataclass(frozen=True)
class Dummy(FirstInvariantLaw):
    """A law of two terms."""

    law: ClassVar[str] = "dummy_law"
    modulus: Annotated[float, Key("half its slope", "stress", POSITIVE)]
    bend: Annotated[float, Key("bend of the dummy", rule=NON_NEGATIVE)] = 0.001

    def energy(self, excess: Any) -> tuple[Any, Any, Any]:
        slope = self.modulus * (1 + 2 * self.bend * excess)
        return self.modulus * (excess + self.bend * excess**2), slope, 2 * self.modulus * self.bend


@dataclass(frozen=True)
class Squashed(Outline):
    """A circle squashed."""

    shape: ClassVar[str] = "dummy_outline"
    reach: Annotated[float, Key("half its length", "length", POSITIVE)]
    flatness: Annotated[float, Key("length over width", rule=_FLATNESS)] = 1.0

    @property
    def semi_axes(self) -> tuple[float, float]:
        return self.reach, self.reach / self.flatness

    def pieces(self) -> tuple[Piece, ...]:
        return (Arc((0.0, 0.0), self.semi_axes),)


@dataclass(frozen=True)
class Cubic:
    """A mechanism whose push grows with the third power of the heave."""

    law: ClassVar[str] = "dummy_bias"
    softening: ClassVar[tuple[tuple[float, float], ...]] = ()
    strength: Annotated[float, Key("push at the unit length", "force", NON_NEGATIVE)]
    unit_length: Annotated[float, Key("where it has that push", "length", POSITIVE)] = 1e-3

    def derivatives(self, heave: Any) -> tuple[Any, Any, Any]:
        x, f, length = heave / self.unit_length, self.strength, self.unit_length
        return f * length * x**4 / 4, f * x**3, 3 * f * x**2 / length


@dataclass(frozen=True)
class DummyRig(Rig):
    """A rig with one more key, which the force on the plate knows."""

    dummy_lift: Annotated[float, Key("of a thread that carries some of the load", "force")] = 0.0

    def force(self, mass: Any, plate_area: Any = 0.0) -> Any:
        return super().force(mass, plate_area) - self.dummy_lift


def tail(setup: Setup, weight: Annotated[float, EffectParameter(
        "mass of the tail", "g", width=1e-3, low=0.0, high=5e-3,
        reason="a test")]) -> Setup:
    return setup.with_rig(unaccounted_mass=setup.rig.unaccounted_mass + weight)


def film(**changes: Any) -> Specimen:
    specimen = circular()
    membrane = replace(specimen.membrane, material=Dummy(9e3, 0.002))
    return replace(specimen, frame=Squashed(50e-3, 1.25), membrane=membrane, **changes)


RIG = DummyRig(biases=(Cubic(1e-3, 2e-3),), dummy_lift=5e-3)

#: Of the parameters below, their unit and a step for a difference.
PARAMETERS = {"membrane.material.modulus": ("Pa", 9.0), "membrane.material.bend": ("1", 2e-6),
              "frame.reach": ("m", 5e-6), "frame.flatness": ("1", 1e-4),
              "rig.biases.0.strength": ("N", 1e-6), "rig.biases.0.unit_length": ("m", 2e-7),
              "rig.dummy_lift": ("N", 5e-6)}


def test_read_and_written(tmp_path: Path) -> None:
    file = tmp_path / "film.toml"
    file.write_text(specimen_to_toml(film()))
    assert load_specimen(file) == film()
    assert 'shape = "dummy_outline"' in file.read_text()
    assert 'modulus = "9 kPa"' in file.read_text()
    rig = tmp_path / "rig.toml"
    rig.write_text(rig_to_toml(RIG))
    assert DummyRig.read(rig) == RIG
    assert 'dummy_lift = "0.005 N"' in rig.read_text()


@pytest.mark.parametrize(("old", "new", "words"), [
    ('modulus = "9 kPa"', 'modulus = "-9 kPa"',
     "membrane.material.modulus: given '-9 kPa': must be positive"),
    ('modulus = "9 kPa"', "modulus = 9", "membrane.material.modulus: given 9: has no unit"),
    ("flatness = 1.25", "flatness = 7", "frame.flatness: given 7: must be from 0.2 to 5"),
    ("flatness = 1.25", "flatnes = 2", "frame.flatnes: unknown key: did you mean 'flatness'"),
])
def test_refused_with_file_key_and_rule(tmp_path: Path, old: str, new: str, words: str) -> None:
    file = tmp_path / "film.toml"
    text = specimen_to_toml(film())
    assert old in text
    file.write_text(text.replace(old, new))
    with pytest.raises(InputError) as raised:
        load_specimen(file)
    assert str(raised.value).startswith(f"{file}: {words}")


def test_listed_and_differentiated() -> None:
    """Every number stands in ``tympan sensitivity`` with its unit, and its derivative is right."""
    case = Case(film(), mass=MASS, voltage=VOLTAGE, rig=RIG)
    answers = sensitivity(case, COARSE).json()["quantities"]["heave"]["by"]
    for name, (unit, step) in PARAMETERS.items():
        assert answers[name]["unit"] == unit
        if not name.startswith("frame."):  # finite differences would mesh anew
            ends = [deflection(name, sign * step) for sign in (1, -1)]
            slope = (ends[0] - ends[1]) / (2 * step)
            assert answers[name]["derivative"] == pytest.approx(slope, rel=1e-4)


def deflection(name: str, step: float) -> float:
    path = name.split(".")
    specimen = film() if path[0] == "rig" else with_change(film(), path, step)
    rig = with_change(RIG, path[1:], step) if path[0] == "rig" else RIG
    case = Case(specimen, mass=MASS, voltage=VOLTAGE, rig=rig)
    deflection_m = solve(case, COARSE).deflection_m
    assert deflection_m is not None
    return deflection_m


def test_lengths_of_an_outline_are_differentiated_right() -> None:
    """A squashed circle answers as the ellipse it is."""
    answers = [sensitivity(Case(replace(film(), frame=frame), mass=MASS, voltage=VOLTAGE), COARSE)
               .json()["quantities"]["heave"]["by"]
               for frame in (Squashed(50e-3, 1.25), Ellipse((50e-3, 40e-3)))]
    along, across = (answers[1][f"frame.semi_axes.{axis}"]["derivative"] for axis in (0, 1))
    assert answers[0]["frame.reach"]["derivative"] == pytest.approx(along + across / 1.25, rel=1e-6)
    assert answers[0]["frame.flatness"]["derivative"] == pytest.approx(-across * 50e-3 / 1.25**2,
                                                                       rel=1e-6)


def test_an_effect_is_applied_and_listed(capsys: pytest.CaptureFixture[str]) -> None:
    setup = EFFECTS["tail"].apply(Setup((film(),), RIG), (2e-3,))
    assert setup.rig == replace(RIG, unaccounted_mass=2e-3)
    with pytest.raises(InputError, match=r"tail\.weight"):
        EFFECTS["tail"].apply(setup, (7e-3,))
    assert listing.listing()["tail"]["parameters"]["weight"]["unit"] == "g"
    assert json.dumps(listing.listing())
    assert main(["effects", "--markdown"]) == 0
    assert "mass of the tail" in capsys.readouterr().out
    assert main(["effects"]) == 0
    assert "tail" in capsys.readouterr().out


def test_documented() -> None:
    page = reference.page(DummyRig)
    for row in ('### law = "dummy_law"',
                "| `modulus` | stress [Pa] | required | must be positive |",
                '### shape = "dummy_outline"',
                "| `flatness` | number | 1 | must be from 0.2 to 5 |",
                '### law = "dummy_bias"',
                "| `unit_length` | length [m] | 1 mm | must be positive |",
                "| `dummy_lift` | force [N] | 0 N |",
                "| tail | weight [g] | 0 | 5 | mass of the tail |"):
        assert row in page


def test_every_signal_is_in_the_help_and_in_the_message(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["transient", "--help"])
    told = capsys.readouterr().out
    with pytest.raises(InputError) as refused:
        Wave("square").signal()
    for kind in WAVES:
        assert kind in told
        assert kind in str(refused.value)
        assert Wave(kind).signal().end > 0


def test_every_file_and_column_of_readings_is_documented(capsys: pytest.CaptureFixture[str],
                                                         tmp_path: Path) -> None:
    """In the how-to, and each file in what a folder without readings is told; rows have units."""
    (tmp_path / "film.toml").write_text(specimen_toml(), encoding="utf-8")
    (tmp_path / "dataset.toml").write_text('name = "empty"\n[[specimen]]\nfile = "film.toml"\n',
                                           encoding="utf-8")
    assert main(["data", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    page = (Path(__file__).parent.parent / "docs" / "howto" / "data.md").read_text("utf-8")
    lines = {line.split("`")[1]: line for line in page.splitlines() if line.startswith("| `")}
    for file, columns in FILES.items():
        assert file in told
        named = re.findall(r"\w+", lines[file])
        missing = [column.title for column in columns if column.title not in named]
        assert not missing, f"docs/howto/data.md: {file} has no {missing}"
    assert {kind for evidence in (*PLATES, CouponTests) for kind in evidence.kinds} <= {*UNITS}


def test_a_class_does_not_take_another_one_s_name() -> None:
    registry: Registry[type] = Registry("name")
    first, second = (type(kind, (), {"name": "spring"}) for kind in ("First", "Second"))
    registry.register(first)
    registry.register(first)  # a notebook's cell that runs again
    with pytest.raises(ValueError, match="'spring' is registered already"):
        registry.register(second)
    assert registry["spring"] is first
