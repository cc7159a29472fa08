"""The page and pictures of a study."""
