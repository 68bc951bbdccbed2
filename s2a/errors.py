"""The one error that a user can mend."""


class InputError(ValueError):
    """Bad input: a file, a key, a part or a value that the user gave.

    The message is one line that names what was given (file, key, part, value), what would have been possible, and what to do.
    The command line prints it and exits with code 2.
    """
