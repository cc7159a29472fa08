"""The process as a whole: the threads of its libraries, and signals that end it."""
