"""The paper's figures computed again, and what is wrong in it."""
