"""Explanations of a misfit by the data alone, without any physics.

Each file seeks one kind of fault in the data and describes it in a sentence. A new one is a
function in a file here, its sentences in ``sentences.toml``, and a line in
:mod:`~tympan.studies.diagnosis.explanations.registry`. They run after the verdict and do not change
it; only another frame of scans is sought before, since it makes a verdict impossible. All are
weighed by :mod:`~tympan.studies.diagnosis.inference.weighing`. Some faults of rows are found before
a film is solved, by the finders of :mod:`tympan.studies.data.checks`.
"""
