"""Cases measured or computed by others: from their data to a section of docs/external.md each."""
