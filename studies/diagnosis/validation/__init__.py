"""What an extended model gains on readings it has not seen."""
