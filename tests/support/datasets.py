"""Datasets written for tests."""

from __future__ import annotations

from pathlib import Path

HEAD = 'name = "test"\n'
SPECIMEN = """[[specimen]]
name = "{name}"
[specimen.frame]
shape = "circle"
radius = "4.5 cm"
[specimen.plate]
shape = "circle"
radius = "1 cm"
[specimen.membrane]
thickness = "1 mm"
prestretch = [2.2360679775, 2.2360679775]
relative_permittivity = 4.7
material = "vhb-4910"
"""


def write_dataset(folder: Path, head: str = HEAD, specimens: tuple[str, ...] = ("A", "B"),
                  **files: str | bytes
                  ) -> Path:
    """A dataset's folder with the given heads and CSV files ("static" for static.csv)."""
    folder.mkdir(exist_ok=True)
    text = head + "".join(SPECIMEN.format(name=name) for name in specimens)
    (folder / "dataset.toml").write_text(text, encoding="utf-8")
    for name, content in files.items():
        raw = content.encode() if isinstance(content, str) else content
        (folder / f"{name}.csv").write_bytes(raw)
    return folder
