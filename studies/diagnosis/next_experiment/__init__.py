"""Which experiment would tell apart what readings leave open."""
