"""Laws fitted to coupon tests."""
