"""What lines over films tell that heaves do not."""
