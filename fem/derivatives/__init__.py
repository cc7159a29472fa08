"""Exact derivatives of results by whatever enters them."""
