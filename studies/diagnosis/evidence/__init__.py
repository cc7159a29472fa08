"""Evidence: what readings of one kind show, look like when they are missed, and are held out by.

One file a kind, each an :class:`~tympan.studies.diagnosis.evidence.kind.Evidence`: a new kind is a
new file here. What is read of plates under loads is a ``PlateEvidence``, which reads its files and
says what its rows show, and stands in :mod:`~tympan.studies.diagnosis.evidence.registry`. A kind
knows readings, setups and effects, not how a film is simulated: that is asked of the films it is
given.
"""
