"""Command line of tympan; the library itself lives in geometry, fem, studies and reports."""
