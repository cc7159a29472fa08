"""What may be wrong with the data where the simulation misses readings, without any physics.

Each file seeks one such explanation and tells it in a sentence. A new one is a function in a file
here, its sentences in ``sentences.toml``, and a line in
:mod:`~tympan.studies.diagnosis.explanations.registry`.
"""
