"""Shape optimisation: the largest stroke at a voltage that limits on stress, field, pull-in and gap leave."""
