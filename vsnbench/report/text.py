"""Makes text from the record harmless: names can come from anywhere, and a report must show them as text."""

import unicodedata

_SHOWN = {"\t": " ", "\n": " ", "\r": " "}


def harmless(text: str) -> str:
    """Return one line of printable text: control, format and other invisible characters become visible escapes.

    A terminal obeys control characters, and the bidirectional ones make a name read as another in a browser.
    """
    return "".join(
        _SHOWN.get(mark, mark if unicodedata.category(mark)[0] != "C" else f"\\x{ord(mark):02x}") for mark in text
    )
