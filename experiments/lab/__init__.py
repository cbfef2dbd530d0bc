"""The laboratory, which measures the project itself; it is no part of the wheel.

`studies` are the commands of `cocap-opt study`, `stored` the results that they have left, and
`manual` what the pages show of the code and of both.
"""
