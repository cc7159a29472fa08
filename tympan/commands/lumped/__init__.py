"""The commands of ``tympan lumped``, by what they do."""
