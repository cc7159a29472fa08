"""What the public door answers: a study's numbers with their picture, files and table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from tympan.geometry.errors import InputError
from tympan.geometry.process.folder import alone

if TYPE_CHECKING:
    import os

    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes

#: How long to wait for another who saves into the same folder [s].
_PATIENCE = 10.0


class _Numbers(Protocol):
    """What every study answers."""

    def json(self) -> Any: ...

    def save(self, folder: Path) -> None: ...


Numbers = TypeVar("Numbers", bound=_Numbers)


@dataclass(frozen=True)
class Result(Generic[Numbers]):
    """The ``numbers`` of a study; all their attributes are the result's own too."""

    numbers: Numbers

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "numbers":  # asked for while it is unpickled
            raise AttributeError(name)
        return getattr(self.numbers, name)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *dir(self.numbers)})

    def plot(self, target: Axes | str | os.PathLike[str] | None = None, **choices: Any) -> Axes:
        """Draw on matplotlib's axes, into a file it can write, or on new axes; answers the axes.

        Modes, and films in time, move in a file NAME.gif. Of a sweep, ``of="stroke",
        over=("plate.radius", "mass"), at="5 kV"`` draws a map over two keys, at one voltage.
        """
        from tympan.reports.plots import plot

        return plot(self.numbers, target, **choices)

    def _repr_html_(self) -> str:
        """As notebooks show it: the result's table, its longest ones cut; one row goes down."""
        from pandas import json_normalize

        table, digits = self.to_pandas(), "{:.6g}".format
        if len(table) != 1:
            return str(table.to_html(index=False, max_rows=12, border=0, na_rep="",
                                     float_format=digits))
        row = json_normalize(table.to_dict("records")).iloc[0].dropna()
        return str(row.to_frame().to_html(header=False, border=0, float_format=digits))

    def save(self, target: str | os.PathLike[str]) -> Path:
        """Write what the command writes into a folder; into NAME.json or NAME.csv numbers alone.

        Raises
        ------
        InputError
            When the name ends in anything else.
        """
        from tympan.studies.files import replaced, write_json, write_text

        target = Path(target)
        if target.suffix == ".json":
            write_json(target, self.numbers.json())
        elif target.suffix == ".csv":
            write_text(target, self.to_pandas().to_csv(index=False))
        elif target.suffix:
            raise InputError("must be a folder, or end in .json or .csv", key="file", given=target)
        else:
            with (alone(target, _PATIENCE),
                  replaced(target, getattr(self.numbers, "pictures", ()))):
                self.numbers.save(target)
        return target

    def to_pandas(self) -> pd.DataFrame:
        """The rows of the result's CSV; a single row where it is one state."""
        from tympan.reports.tables import table

        return table(self.numbers)

    def to_xarray(self) -> xr.Dataset:
        """The same as an xarray dataset; a sweep's has specimen, mass and voltage as dimensions."""
        grid: xr.Dataset | None = getattr(self.numbers, "table", None)
        return self.to_pandas().to_xarray() if grid is None else grid
