"""Experiments that would tell apart what readings leave open."""
