"""Pictures of the nominal and the extended model in a report: curves, films under load."""
