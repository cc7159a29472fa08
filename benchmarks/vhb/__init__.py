"""Coupon tests of VHB tape, and what `tympan material fit` makes of them."""
