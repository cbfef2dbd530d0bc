"""The command line, `cocap-opt`: a module per family of commands."""
