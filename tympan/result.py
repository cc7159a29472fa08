"""Results of the public functions: a study's numbers with their picture, files and table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, Protocol, TypeVar

from tympan.base.errors import InputError
from tympan.base.fields import EMPTY
from tympan.base.process.folder import alone
from tympan.geometry.specimen import Specimen

if TYPE_CHECKING:
    import os

    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes

    from tympan.studies.film_surface import FilmSurface

#: Longest wait for another process that saves into the same folder [s].
_PATIENCE = 10.0


class _Numbers(Protocol):
    """Interface of every study's answer."""

    def json(self) -> Any: ...

    def save(self, folder: Path) -> None: ...


Numbers = TypeVar("Numbers", bound=_Numbers)


def file_writers(kind: type, file: Path, key: str = "file"
                 ) -> Mapping[str, Callable[[Any, Path], None]]:
    """Find writers of a kind of numbers, by the ending of a file's name.

    Raises
    ------
    InputError
        When no writer exists for the ending of the file's name.
    """
    writers: Mapping[str, Callable[[Any, Path], None]] = getattr(kind, "writers", {})
    *others, last = dict.fromkeys((".json", ".csv", *writers))
    if file.suffix not in (*others, last):
        folder = "be a folder, or " * (key == "file")
        raise InputError(f"must {folder}end in {', '.join(others)} or {last}", key=key, given=file)
    return writers


@dataclass(frozen=True)
class Result(Generic[Numbers]):
    """The ``numbers`` of a study; all their attributes are attributes of the result, too.

    ``actuator``: the solved actuator, for a result that has fields.
    """

    numbers: Numbers
    actuator: Specimen | None = None

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "numbers":  # asked for while it is unpickled
            raise AttributeError(name)
        return getattr(self.numbers, name)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *dir(self.numbers)})

    def plot(self, target: Axes | str | os.PathLike[str] | None = None, **choices: Any) -> Axes:
        """Draw on matplotlib's axes, into a file it can write, or on new axes; return the axes.

        Modes, and films in time, move in a file NAME.gif. Of a sweep, ``of="stroke",
        over=("plate.radius", "mass"), voltage="5 kV"`` draws a map over two keys, at one voltage.
        """
        from tympan.reports.plots import plot

        return plot(self.numbers, target, **choices)

    def __repr__(self) -> str:
        """Write the table of a notebook as text."""
        from tympan.reports.tables import text

        return f"{type(self.numbers).__name__}\n{text(self.numbers)}"

    def _repr_html_(self) -> str:
        """Write a table of names, values and units for a notebook, with a picture if there is one.

        A long table is cut; a single row is shown as a column.
        """
        from base64 import b64encode

        from tympan.reports.plots import png
        from tympan.reports.tables import html

        drawn = png(self.numbers)
        picture = "" if drawn is None else (
            f'<img src="data:image/png;base64,{b64encode(drawn).decode()}" '
            'alt="picture of the values above">')
        return html(self.numbers) + picture

    def save(self, target: str | os.PathLike[str]) -> Path:
        """Write the command's files into a folder: numbers, fields and pictures.

        Into NAME.json or NAME.csv go the numbers alone. The matrices of ``lumped.linearise`` also
        go into NAME.mat or NAME.npz.

        Raises
        ------
        InputError
            When the name ends in anything else.
        """
        from tympan.reports.rebuild import draw_result
        from tympan.studies.files import replaced, write_json, write_text

        if not str(target).strip():
            raise InputError(EMPTY, key="target", given=target)
        target = Path(target)
        if target.suffix:
            writers = file_writers(type(self.numbers), target)
            if target.suffix in writers:
                writers[target.suffix](self.numbers, target)
            elif target.suffix == ".json":
                write_json(target, self.numbers.json())
            else:
                write_text(target, self.to_pandas().to_csv(index=False))
        else:
            with (alone(target, _PATIENCE),
                  replaced(target, getattr(self.numbers, "pictures", ()))):
                self.numbers.save(target)
                draw_result(self.numbers, target)
        return target

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Result[Any]:
        """Read back what :meth:`save` or a command stored in a folder.

        It is the same result, with the digits of its files. Where several are there, give the file
        of one. The ``actuator`` is not stored: :meth:`line` goes through the frame's centre.

        Raises
        ------
        InputError
            When nothing or several results are stored there.
        """
        from tympan.reports.rebuild import stored_results

        given = Path(folder)
        if not given.exists():
            raise InputError("does not exist: give the folder of a stored result, or its file",
                             file=given)
        stored = stored_results(given if given.is_dir() else given.parent)
        if not given.is_dir():
            stored = [(kind, file) for kind, file in stored if file.name == given.name]
        if len(stored) != 1:
            raise InputError("must be one of " + ", ".join(str(file) for _, file in stored)
                             if stored else "is no stored result", key="folder", given=folder)
        (kind, file), = stored
        return cls(kind.load(file))

    def compare(self, other: Result[Any] | str | os.PathLike[str]) -> pd.DataFrame:
        """List the values that differ from another result, as :func:`tympan.compare` does."""
        from tympan.door import compare

        return compare(self, other)

    def __getitem__(self, name: str) -> Any:
        """Return numbers of the table by a column's name, with or without its unit.

        ``result["stroke"]`` is an array with one number for each row, and one number of one state.

        Raises
        ------
        InputError
            When there is no such column, with the names of those that there are.
        """
        from tympan.studies.columns import column_named

        table = self.to_pandas()
        numeric = [str(label) for label in table.columns if table[label].dtype.kind in "fi"]
        values = table[column_named(name, numeric, "name")].to_numpy()
        return values.item() if len(values) == 1 else values

    def to_pandas(self) -> pd.DataFrame:
        """Convert the rows of the result's CSV to a table; one state has a single row."""
        from tympan.reports.tables import table

        return table(self.numbers)

    @property
    def fields(self) -> xr.Dataset:
        """Stretches, stresses and other fields at points of the film, with their units, by xarray.

        ``fields["stress_1"].max()``; ``x`` and ``y`` are places in the flat film [m].
        """
        from tympan.reports.tables import labelled

        film = self._film()
        x, y, _ = film.mounted.T
        return labelled(film.values, "point", x=x, y=y)

    def at(self, x: Any, y: Any) -> xr.Dataset:
        """Interpolate the fields at places of the flat film: numbers [m], texts or arrays.

        They are nan outside the film, and linear between the points of :attr:`fields`.
        """
        import numpy as np

        from tympan.base.units import quantity
        from tympan.reports.tables import labelled

        x, y = (quantity(value, "length") if isinstance(value, str) else value for value in (x, y))
        places = np.column_stack([part.ravel() for part in np.broadcast_arrays(
            np.atleast_1d(x).astype(float), np.atleast_1d(y).astype(float))])
        return labelled(self._film().at(places), "point", x=places[:, 0], y=places[:, 1])

    def line(self, along: Literal["x", "y"], points: int = 201) -> xr.Dataset:
        """Interpolate the fields on the line along x or y through the plate's centre [m].

        ``result.line("x")["stress_1"]`` has ``distance`` from the centre as its coordinate. Under
        the plate the fields are nan, so that a drawn curve has a gap there.
        """
        import numpy as np

        from tympan.reports.tables import labelled

        if along not in ("x", "y"):
            raise InputError("must be x or y", key="along", given=str(along))
        film, axis = self._film(), "xy".index(along)
        plate = None if self.actuator is None else self.actuator.plate
        centre = np.array((0.0, 0.0) if plate is None else plate.offset)
        ends = film.mounted[:, axis].min(), film.mounted[:, axis].max()
        places = np.tile(centre, (points, 1))
        places[:, axis] = np.linspace(*ends, points)
        values = film.at(places)
        film_at = np.flatnonzero(np.isfinite(values["thickness"]))
        there = slice(film_at[0], film_at[-1] + 1)  # from edge to edge
        return labelled({name: value[there] for name, value in values.items()}, "distance",
                        distance=places[there, axis] - centre[axis])

    def _film(self) -> FilmSurface:
        film: FilmSurface | None = getattr(self.numbers, "film", None)
        if film is None:
            raise InputError("there is no film to read fields of: "
                             + ("; ".join(getattr(self.numbers, "warnings", ())) or
                                "this kind of result has none"))
        return film

    def to_xarray(self) -> xr.Dataset:
        """Convert the result to an xarray dataset, with dimensions and units.

        The dimensions are the varied quantities: specimen, mass and voltage of a sweep, voltage and
        displacement of a force curve. One state has numbers, and its fields by ``point``.
        """
        from tympan.reports.tables import dataset

        return dataset(self.numbers)
