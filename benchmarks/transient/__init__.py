"""What films in time cost."""
