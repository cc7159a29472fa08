"""Pages speak to those who do not see them, colours to those who see few."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib import colormaps

from tests.support.checks.accessible import wordless
from tympan.reports import look

ROOT = Path(__file__).parents[2]
#: Machado, Oliveira, Fernandes, IEEE Trans. Vis. Comput. Graph. 15 (2009) 1291, severity 1, on
#: linear RGB; and an eye that sees all colours.
EYES = {
    "all": np.eye(3),
    "no red": np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                        [-0.003882, -0.048116, 1.051998]]),
    "no green": np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                          [-0.011820, 0.042940, 0.968881]]),
    "no blue": np.array([[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                         [0.004733, 0.691367, 0.303900]]),
}


def lightness(name: str, eye: str) -> np.ndarray:
    """CIE L* along a colour map, as an eye sees it; IEC 61966-2-1 for sRGB."""
    colours = colormaps[name](np.linspace(0, 1, 65))[:, :3]
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ EYES[eye].T, 0, 1) @ np.array([0.2126, 0.7152, 0.0722])
    return np.where(seen > (6 / 29) ** 3, 116 * np.cbrt(seen) - 16, seen * (29 / 3) ** 3)


def maps_drawn_with() -> set[str]:
    """Names of colour maps in lines that choose one."""
    lines = [line for folder in ("reports", "studies", "tympan/commands", "docs/gallery")
             for file in (ROOT / folder).rglob("*.py")
             for line in file.read_text(encoding="utf-8").splitlines()
             if re.search("cmap|COLOURS|colormaps", line)]
    return {word for line in lines for word in re.findall(r'"(\w+)"', line) if word in colormaps}


#: About a middle that is drawn lightest; the others go from dark to light, or back.
ABOUT_ZERO = {"RdBu_r"}


def test_fields_are_drawn_in_the_one_map() -> None:
    assert look.COLOURS in maps_drawn_with()
    assert maps_drawn_with() >= ABOUT_ZERO


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("name", sorted(maps_drawn_with() - ABOUT_ZERO))
def test_maps_grow_lighter_for_every_eye(name: str, eye: str) -> None:
    steps = np.diff(lightness(name, eye))
    assert (steps > 0).all() or (steps < 0).all()


@pytest.mark.parametrize("eye", EYES)
def test_the_map_of_fields_grows_lighter_evenly(eye: str) -> None:
    coarse = np.diff(lightness(look.COLOURS, eye)).reshape(8, -1).sum(axis=1)
    assert coarse.max() < 2 * coarse.min()


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("name", ABOUT_ZERO)
def test_maps_about_zero_grow_darker_both_ways(name: str, eye: str) -> None:
    """Both ends as dark: what is grey tells how much, the colour which way."""
    seen = lightness(name, eye)
    middle = len(seen) // 2
    assert abs(int(seen.argmax()) - middle) <= 1
    assert (np.diff(seen[:middle]) > 0).all()
    assert (np.diff(seen[middle + 1:]) < 0).all()


def test_what_says_nothing_is_found() -> None:
    page = ('<img src="a.png"><img src="b.png" alt=" "><canvas></canvas><input id="x">'
            '<label for="y">y</label><select id="y"></select><label>z <input></label>'
            '<img src="c.png" alt="a film"><canvas aria-label="a film"></canvas>')
    assert wordless(page) == ['<img src="a.png">', '<img src="b.png" alt=" ">', "<canvas>",
                              '<input id="x">']
