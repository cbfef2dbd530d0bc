"""Text of files as it is shown."""


def printable(text: str) -> str:
    """Returns the text with line breaks, control and other non-printable characters escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
