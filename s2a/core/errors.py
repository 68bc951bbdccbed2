"""The error that a user can fix, the verdict that is not an error, and texts of others in messages."""


class InputError(ValueError):
    """Bad input: a file, a key, a part or a value that the user gave.

    The message is one line that names what was given (file, key, part, value), what is possible, and what to do.
    The command line prints it and exits with code 2.
    """


class CheckFailed(Exception):
    """A check ran and failed.

    The message is the result, as a command would return it; the command line prints it on stdout and exits with code 1.
    """


def printable(text: str) -> str:
    """Return a text with a space for every character that a terminal would not show but obey, such as ESC."""
    return "".join(letter if letter.isprintable() else " " for letter in encodable(text))


def encodable(text: str) -> str:
    """Return a text with ? for every half of a character (a lone surrogate), which no file and no request can hold."""
    return text.encode("utf-8", "replace").decode()
