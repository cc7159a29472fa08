"""All effects, in the order in which several are applied.

What an effect says of itself stands in its decorator and in its parameters.
"""

# isort: off
from tympan.studies.effects.library import films as films
from tympan.studies.effects.library import segments as segments
from tympan.studies.effects.library import rig as rig
from tympan.studies.effects.library import in_time as in_time
from tympan.studies.effects.library import strips as strips
