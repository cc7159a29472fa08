"""Effects at the plate."""
