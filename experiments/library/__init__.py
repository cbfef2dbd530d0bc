"""The library: instances from easy to open, each with its best plan and best verified bound.

`entries` reads the list of instances and makes them again, `judge` has `cocap-check` say what a
file proves, `records` keeps what was accepted, `tables` and `page` show it. The data are in `data`:
`instances.toml` is the list, written by hand; `digests.csv` and `records.csv` are written by
commands, and `files` holds the plans and certificates.
"""
