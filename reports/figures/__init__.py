"""Figures, one file for each command.

Each has a function that draws a result into a folder and answers the files, as
``reports/rebuild.py`` lists them. Fonts, colours and sizes come from ``reports/look.py``.
"""
