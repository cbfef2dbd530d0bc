"""Exit codes of commands; 0 is success, even if the result is that there is no plan."""

FAILED = 1  # a claim does not hold, numbers differ, or a computation ended with an error
WRONG_INPUT = 2
UNDECIDED = 3  # some of it
INTERRUPTED = 130  # Ctrl-C came before any result, or before all scenes and seeds were complete
