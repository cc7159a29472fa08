"""A live page: a film in colours that follows sliders, and its curve (``tympan explore``)."""
