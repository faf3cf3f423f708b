"""From a target to a program: the stages in their order, with their time."""
