"""What is kept of a trial."""

from __future__ import annotations

from dataclasses import MISSING, asdict, dataclass, fields
from typing import Any

from tympan.studies.diagnosis.inference.identifiability import SEEN, TOLD


@dataclass(frozen=True)
class Record:
    """A trial and its end.

    ``seen``: χ² by which the nominal model misses the readings without noise more than the truth
    does (of a stranger: by which the best of the library does); ``told``: the same for the best
    hypothesis that is not the truth. ``ranked`` are the causes with their stated probabilities.
    ``covered``: whether the 95 % set of hypotheses has the truth, but for effects of which the
    verdict says that these readings cannot see them, ``inside``: whether the 95 % intervals of its
    sizes have the true ones, None where that was not asked. ``reported``: whether
    an alias was called one. ``ratio``: error beyond noise on readings held out, of the extended
    model over the nominal one, over all splits that can show it; None where there is none.
    ``widths``: how many usual sizes each hidden effect has. ``listed``: the causes an ambiguous
    verdict is between. ``predicted``: how many readings held out were within their 95 % bands, and
    how many there were. ``rows``: how many readings, specimens or columns at fault were told, how
    many there were, and how many others were told. ``limits``: those of the gain's ratio that are
    claimed, ``held``: the ratio at states that were held back, without noise.
    """

    population: str
    number: int
    means: str
    truth: tuple[str, ...]
    again: int
    seen: float
    told: float
    verdict: str = "refused"
    named: tuple[str, ...] = ()
    ranked: tuple[tuple[str, float], ...] = ()
    best: tuple[str, ...] = ()
    wrong: float = 0.0
    unknown: float = 0.0
    p_value: float = 1.0
    after: float = 1.0
    noise: float = 1.0
    covered: bool | None = None
    inside: tuple[bool, ...] = ()
    reported: bool | None = None
    words: str = ""
    ratio: float | None = None
    widths: tuple[float, ...] = ()
    listed: tuple[str, ...] = ()
    predicted: tuple[int, ...] = ()
    rows: tuple[int, ...] = ()
    limits: tuple[float, ...] = ()
    held: float | None = None

    @property
    def identifiable(self) -> bool:
        """Whether the truth stands out by itself."""
        return self.seen >= SEEN and self.told >= TOLD

    @property
    def misnamed(self) -> bool:
        """Whether a cause was named that is not there."""
        return bool(set(self.named) - set(self.truth))

    def json(self) -> dict[str, Any]:
        """A JSON object of what is known: values that differ from those of a blank record."""
        blank = {field.name: field.default for field in fields(self)
                 if field.default is not MISSING}
        return {name: value for name, value in asdict(self).items()
                if name not in blank or value != blank[name]}

    @classmethod
    def of_json(cls, content: dict[str, Any]) -> Record:
        """From one."""
        lists = {name: tuple(map(tuple, value)) if name == "ranked" else tuple(value)
                 for name, value in content.items() if isinstance(value, list)}
        return cls(**(content | lists))
