"""How long anybody waits for OpenCASCADE: a module of its own, which commands read before anything heavy is loaded."""

from __future__ import annotations

STEP_LIMIT_S = 60.0  # for one STEP file; most parts take one or two, freeform ones of 40 features up to 30
