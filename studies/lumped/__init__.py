"""The paper's lumped model: Eqs. (2)–(10) for any number of circles, its statics, dynamics and identification."""
