"""The command line, `cocap-opt`."""
