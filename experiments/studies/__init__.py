"""The project's own measurements: the paper, start sets, growth, solvers, views."""
