"""The subcommands of ``tympan lumped``."""
