"""Trials: effects hidden in readings, and random specimens, judged in hundreds."""
