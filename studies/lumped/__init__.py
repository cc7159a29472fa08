"""The paper's lumped model: Eqs. (2)–(10) for any number of circles, at rest and in time."""
