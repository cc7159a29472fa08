"""Patterns of misfits: smooth columns of readings, of films and of coupons."""
