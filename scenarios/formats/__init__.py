"""Readers of scene files, one module for each format.

A reader has `read(path, seed)`, which returns the Problem; `read(path, seed, options)` where its
format has options; and `read_plan(path, problem)`, which returns one path of states per robot,
where plans of its format can be read. Readers raise a ProblemError of one line that names the file.
They are listed in `cocap_opt.scenarios.FORMATS` and imported when a file needs them.
"""
