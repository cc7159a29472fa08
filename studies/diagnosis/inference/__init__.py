"""From readings to probabilities: fits, tests of what is left, evidence, verdict."""
