"""How soon the explorer follows a slider (``python -m benchmarks.explore``)."""
