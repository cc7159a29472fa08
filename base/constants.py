"""Constants of nature; ``scipy.constants`` reads all of CODATA first, which takes 10 ms."""

from __future__ import annotations

#: Electric permittivity of vacuum [F/m], CODATA 2022.
EPSILON_0 = 8.8541878188e-12
#: Standard acceleration of gravity [m/s²], exact by definition.
STANDARD_GRAVITY = 9.80665
