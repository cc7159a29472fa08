"""What a misfit may look like: smooth columns of readings, of films and of coupons."""
