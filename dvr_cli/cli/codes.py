"""Exit codes that are no DvrError's (those carry their own: 2 usage, 3 input, 4 output)."""

DONE = 0
GATE_FAILED = 1
INTERNAL_ERROR = 1
INTERRUPTED = 130
