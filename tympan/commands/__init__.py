"""The subcommands of ``tympan``, one file each."""
