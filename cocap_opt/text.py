"""Text of files as it is shown."""


def printable(text: str) -> str:
    """Text with escapes for what is no text, or would steer a terminal or begin a line."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
