"""Evidence: for each kind of readings, their prediction, their misfit patterns, held-out splits.

Each kind is one file with an :class:`~tympan.studies.diagnosis.evidence.kind.Evidence`; a new kind
is a new file here. Readings of loaded plates are a ``PlateEvidence``, which reads its files and
predicts its rows, and is registered in :mod:`~tympan.studies.diagnosis.evidence.registry`. A kind
knows readings, setups and effects. It does not know how a film is simulated: it asks the films that
it is given.
"""
