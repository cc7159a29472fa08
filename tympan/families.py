"""Many films at once from a script: the family of reduced films."""

from __future__ import annotations

from tympan.studies.films.family import FilmFamily as FilmFamily
