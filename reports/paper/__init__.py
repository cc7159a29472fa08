"""The page and pictures of the paper's figures, computed again."""
