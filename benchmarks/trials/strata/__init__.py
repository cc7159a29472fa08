"""Effects hidden in more kinds of evidence than readings at rest."""
