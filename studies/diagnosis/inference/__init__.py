"""Steps from readings to probabilities: tests of what is left, posterior, verdict.

It asks a :class:`~tympan.studies.diagnosis.evidence.kind.ReadingModel` what readings show and how
far it reaches, and knows no film: a contract keeps that. A new test or search is a new file here.
"""
