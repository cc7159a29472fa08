"""Python imports this at the start of every process of a run that records its blocks."""

import os

if "TYMPAN_MUTANTS_MAP" in os.environ:
    import block_trace

    block_trace.install()
