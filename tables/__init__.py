"""Tables of testers and laboratories: formats, headings, columns and their units."""
