"""A key of a dimension that nobody declared is refused where it is declared."""

from __future__ import annotations

import pytest

from tympan.base.fields import Key


def test_a_dimension_that_is_not_declared_is_named_with_what_to_do() -> None:
    with pytest.raises(ValueError, match=r"'cubic stiffness' is no dimension: add it to .*DIMENS"):
        Key("of a spring", "cubic stiffness")
