"""Effects between supply and film."""
