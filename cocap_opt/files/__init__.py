"""Files of this project: JSON with a version, written whole or not at all.

`documents` is the one scheme of all kinds of files, `atomic_write` how they are written,
`strict_json` how JSON is read, `messages` what errors in it are called, `code` the digest of
code by which stored results are known, `known_digests` how it is kept, and `users_folder` the place
of what can be made again.
"""

__all__ = [
    "atomic_write", "code", "documents", "known_digests", "messages", "strict_json", "users_folder",
]  # fmt: skip
