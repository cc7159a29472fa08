"""Shape optimisation.

The largest stroke at a voltage that limits on stress, field, pull-in and gap leave.
"""
