"""Notebooks that tell what the project is about, stored with their outputs.

Their cells hold text, calls and what these return; what has to be computed for them is in
`tables` and `figures`. `cocap-opt study notebooks` runs them again and stores them.
"""
