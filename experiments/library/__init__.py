"""The library: instances from easy to unsolved, each with its best plan and best verified bound.

`entries` reads the list of instances and makes their scenes, `judge` runs `cocap-check` on files,
`records` keeps the improvements that were accepted, and `tables` and `page` show them. The data are
in `data`: `instances.toml` is the list, written by hand; commands write `digests.csv` and
`records.csv`; `files` holds the plans and certificates.
"""
