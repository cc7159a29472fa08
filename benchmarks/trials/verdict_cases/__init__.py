"""Datasets with something hidden in them, as folders that any program can be tried on.

Each folder under ``cases`` is a dataset, with ``expected.json`` beside what a laboratory would
have:

* ``hidden``: what is the case, in words;
* ``verdict``: the verdicts that are right;
* ``causes``: the effects to be named, or to be among those listed where they cannot be told apart;
* ``parameters``: the values they have, in units of files.
"""
