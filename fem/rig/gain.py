"""Gain errors k of amplifier, sensor and gauge: 1 + k times the true value."""

from tympan.base.toml_reader import Rule

#: Limits of a gain error. A gain of 0 has no inverse; one of 11 is another instrument.
GAIN: Rule = (lambda x: -1 < x < 10, "must be above -1 and below 10")
