"""Measured data: datasets, their columns, readings and noise."""

from tympan.studies.data import coupon_formats as coupon_formats
