"""A person at the terminal of a program: types answers when it asks."""

import os
import pty
import re
import select
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence

_ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
_LOOKED_AT = 2000
"""Number of the last characters in which a question is sought: a progress bar writes a megabyte."""
Answers = Mapping[str, Callable[["re.Match[str]"], str]]
"""The answer to each question, by a regular expression that matches to the end of what is shown."""


def converse(words: Sequence[str], environment: dict[str, str], answers: Answers, patience_s: float) -> tuple[int, str]:
    """Run a program in a terminal, answer its questions, and return its exit code and all that it showed."""
    ours, theirs = pty.openpty()
    program = subprocess.Popen(
        words, env=environment, stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True
    )
    os.close(theirs)
    shown, answered, give_up_s = "", 0, time.monotonic() + patience_s
    try:
        while chunk := _read(ours, give_up_s):
            shown += _ESCAPES.sub("", chunk)
            unanswered = shown[max(answered, len(shown) - _LOOKED_AT) :]
            for question, answer in answers.items():
                if asked := re.search(rf"(?:{question})\s*\Z", unanswered):
                    answered = len(shown)
                    os.write(ours, f"{answer(asked)}\n".encode())
                    break
        return program.wait(30), shown
    finally:
        if program.poll() is None:
            program.terminate()
            program.wait(30)
        os.close(ours)


def _read(terminal: int, give_up_s: float) -> str:
    """Return what the program has written; empty after its end."""
    if not select.select([terminal], [], [], max(0.0, give_up_s - time.monotonic()))[0]:
        raise TimeoutError("the program still runs")
    try:
        return os.read(terminal, 65536).decode(errors="replace")
    except OSError:  # the program has closed its end
        return ""
