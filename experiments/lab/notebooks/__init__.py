"""Notebooks that tell what the project is about, stored with their outputs.

Their cells hold text, and calls to `import cocap_opt as co` and their results, no logic.
`cocap-opt study notebooks` runs them again and stores them.
"""

__all__: list[str] = []
