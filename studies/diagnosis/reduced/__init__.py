"""The films' reduced model: the force at a held plate, and the readings it makes."""
