"""The page of a sweep: maps, films, a table, and what failed."""
