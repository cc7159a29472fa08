"""Coupons as evidence: their readings, what of them is held out, what is stored."""
