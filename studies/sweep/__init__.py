"""Many specimens under many loads, planned from SWEEP.toml: kept case by case, one table.

``plan.py`` checks the plan, ``task.py`` is what one process solves, ``run.py`` keeps what is
finished and ``table.py`` lays it out; ``best.py`` looks for the best cases, ``cluster.py`` is for
several machines. What may be asked of a specimen beside its cases is added in ``asked.py`` alone.
"""
