"""Laws fitted to coupon tests.

``fit.py`` fits all laws at rest, ``branches.py`` laws with viscous branches in time
(``relaxation.py``), where ``time_in_runs.py`` says that the runs tell time from stretch.
``film.py`` says what they leave open of an actuator; ``result.py`` is saved and drawn. A law that
is to be fitted needs an entry in ``families.py``.
"""
