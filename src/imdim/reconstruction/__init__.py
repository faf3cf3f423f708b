"""From a target to a program: the stages in their order (`pipeline`), the methods, and the time that each may take (`budget`)."""
