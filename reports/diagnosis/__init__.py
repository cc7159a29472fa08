"""The page and pictures of a diagnosis."""
