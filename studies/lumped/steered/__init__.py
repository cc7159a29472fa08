"""An actuator whose segments tilt its plate: a lumped model of several freedoms and inputs.

``model.py`` is the model, ``inverse.py`` the voltages that hold a plate, ``law.py`` a controller,
``run.py`` runs it on the film in time.
"""
