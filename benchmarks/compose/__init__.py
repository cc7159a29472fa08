"""Every question asked of every kind of film and rig: what is refused, what fails, what differs.

Films, rigs and questions come from the registries, see :mod:`benchmarks.compose.concepts` and
:mod:`benchmarks.compose.questions`; what is registered later joins by itself.
"""
