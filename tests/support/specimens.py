"""Specimens and laws the tests share."""

from __future__ import annotations

from dataclasses import replace
from math import pi

from tests.oracles import axisymmetric
from tympan.fem.film.laws import Ogden
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Electrode, Film, Material, Plate, Segment, Specimen

ROOT5 = 5**0.5
NEO_HOOKE = Ogden((25e3,), (2.0,))

#: Frames and films of specimen files.
ROUND = 'shape = "circle"\nradius = "4.5 cm"'
OVAL = 'shape = "ellipse"\nsemi_axes = ["6 cm", "4.5 cm"]'
VHB = 'material = "vhb-4910"'
SOFT = '[membrane.material]\nlaw = "ogden"\nmu = ["15 kPa"]\nalpha = [2]'


def specimen_toml(name: str = "oval", frame: str = OVAL, film: str = VHB,
                  prestretch: float = 2.236) -> str:
    """A specimen's file: a frame, a plate of 1 cm, and 1 mm of film."""
    return f"""
name = "{name}"
[frame]
{frame}
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = [{prestretch}, {prestretch}]
relative_permittivity = 4.7
{film}
"""


#: A film with an electrode of its own outline.
PATCH_TOML = specimen_toml("patch", ROUND, VHB, 2.2) + """
[electrode]
margin_plate = "1 mm"
[electrode.outline]
shape = "ellipse"
semi_axes = ["3 cm", "20 mm"]
offset = ["1 cm", "0 mm"]
"""


def circular(material: Material = NEO_HOOKE, **film: object) -> Specimen:
    """The reference annulus, 10 mm to 45 mm, 1 mm thick before it is stretched by √5."""
    values: dict[str, object] = {"thickness": 1e-3, "prestretch": (ROOT5, ROOT5),
                                 "relative_permittivity": 4.7}
    return Specimen("circle", Circle(45e-3), Plate(Circle(10e-3)),
                    Film(material=material, **(values | film)))


def quarters(gap: float = 0.0, shares: tuple[float, ...] = (1.0,) * 4, start: float = 0.0,
             specimen: Specimen | None = None) -> Specimen:
    """A film whose electrode is in four sectors A, B, C, D, counterclockwise from ``start``."""
    segments = tuple(Segment(name=name, share=share,
                             sector=(start + number * pi / 2, start + (number + 1) * pi / 2))
                     for number, (name, share) in enumerate(zip("ABCD", shares, strict=True)))
    return replace(specimen or circular(), electrode=Electrode(segments=segments, gap=gap))


def elliptical(long: float, material: Material = NEO_HOOKE) -> Specimen:
    """The paper's ellipses: semi-axes ``long`` and 45 mm."""
    return replace(circular(material), name=f"ellipse {long}", frame=Ellipse((long, 45e-3)))


def skewed() -> Specimen:
    """Without any symmetry: plate off centre, anisotropic prestretch, electrode margins, stiffness.
    """
    material = Ogden((16e3, 300.0), (1.7, 4.2))
    film = Film(1e-3, (2.4, 2.1), material, 4.7, permittivity_exponent=0.3, density=960.0)
    return Specimen("skewed", Ellipse((60e-3, 45e-3)), Plate(Circle(10e-3), (8e-3, -5e-3)), film,
                    Electrode(3e-3, 2e-3, 1.5e3))


def reference_film(material: Ogden, **film: float) -> axisymmetric.Film:
    """:func:`circular` for the axisymmetric equations."""
    values = {"inner": 10e-3, "outer": 45e-3, "thickness": 1e-3, "prestretch": ROOT5,
              "relative_permittivity": 4.7}
    return axisymmetric.Film(material=axisymmetric.Ogden(material.mu, material.alpha),
                             **(values | film))
