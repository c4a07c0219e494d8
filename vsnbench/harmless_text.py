"""Makes text from the record harmless: names can come from anywhere, and a reader must see them as text."""

import unicodedata

_SPACES = {"\t", "\n", "\r"}


def harmless(text: str) -> str:
    """Return one line of printable text: control, format and other invisible characters become visible escapes.

    A terminal obeys control characters, and the bidirectional ones make a name read as another in a browser.
    """
    return text if text.isprintable() else "".join(mark if mark.isprintable() else _visible(mark) for mark in text)


def _visible(mark: str) -> str:
    if mark in _SPACES or unicodedata.category(mark) == "Zs":
        return " "
    return ascii(mark)[1:-1]
