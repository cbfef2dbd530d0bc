"""The laboratory, which measures the project itself; it is not part of the wheel.

`studies` contains the commands of `cocap-opt study`, `stored` their stored results, and `manual`
the parts of the pages that are made from the code and from stored results.
"""
