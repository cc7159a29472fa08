"""The reference page is what the declarations say now."""

from __future__ import annotations

from pathlib import Path

from tympan.reports import reference


def test_the_page_is_current() -> None:
    page = Path(__file__).parents[2] / "docs" / "reference.md"
    assert page.read_text(encoding="utf-8") == reference.page(), \
        "run python -m tympan.reports.reference > docs/reference.md"
