"""Steps from readings to probabilities: tests of residuals, posterior, verdict.

It asks a :class:`~tympan.studies.diagnosis.evidence.kind.ReadingModel` for predictions and for
their range, and does not depend on films: an import contract ensures that. A new test or search is
a new file here.
"""
