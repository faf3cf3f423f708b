"""A deadline that has passed, whatever the clock says."""

import math

from imdim.deadline import Deadline

PASSED = Deadline(-math.inf)
