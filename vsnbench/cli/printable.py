"""Text from the record made safe to print: terminal escapes and line breaks become visible characters."""


def printable(text: str) -> str:
    """Return the text with every character that a terminal would act on shown as an escape."""
    return "".join(character if character.isprintable() else ascii(character)[1:-1] for character in text)
