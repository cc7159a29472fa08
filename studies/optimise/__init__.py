"""Shape optimisation: the largest stroke that stress, field, pull-in and gap leave."""
