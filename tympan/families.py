"""Families of reduced films: many films at once from a script."""

from __future__ import annotations

from tympan.studies.films.family import FilmFamily as FilmFamily
