"""Which experiment would tell the rivals apart."""
