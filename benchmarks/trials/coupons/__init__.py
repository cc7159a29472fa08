"""Coupons by closed forms, and how often limits from them hold."""
