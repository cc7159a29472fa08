"""What records of trials add up to: rates with intervals, pages, pictures."""
