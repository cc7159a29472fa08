"""Drawings as programs write them: each is read right, or refused with advice that works."""

from benchmarks.trials.drawings import dxf, step
from benchmarks.trials.drawings.case import CASES, Case

__all__ = ["CASES", "Case", "dxf", "step"]
