"""Cases, studies, and the weights α of the lumped model."""
