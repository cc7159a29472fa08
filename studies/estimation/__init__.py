"""Estimating numbers from data: search, profiles, what is identifiable."""
