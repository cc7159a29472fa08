"""What a report shows of the nominal and the extended model: curves, and films under load."""
