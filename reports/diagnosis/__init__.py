"""The page and pictures of a diagnosis.

All are drawn from :class:`~tympan.studies.diagnosis.result.Diagnosis` alone. ``page.py`` writes
the page, whose sentences are in ``words.txt``; ``figures.py`` draws readings, ``film_maps.py``
films, ``strip_figure.py`` coupons and ``self_check.py`` the page of synthetic readings.
"""
