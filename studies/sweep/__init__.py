"""Many specimens under many loads, planned in SWEEP.toml: stored case by case, in one table.

``plan.py`` checks the plan, ``task.py`` solves one specimen in one process, ``run.py`` stores
finished cases and ``table.py`` makes the table. ``best.py`` finds the best cases, ``cluster.py``
uses several machines. Further questions on a specimen are added in ``asked.py`` alone.
"""
