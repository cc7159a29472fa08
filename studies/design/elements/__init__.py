"""A search by finite elements: the largest stroke that stress, field, film's end and gap leave.

``space`` has what varies, ``evaluator`` computes a design with its derivatives, ``optimise`` goes
from every start and makes the result.
"""
