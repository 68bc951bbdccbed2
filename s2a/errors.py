"""The error that a user can fix, and the verdict that is not an error."""


class InputError(ValueError):
    """Bad input: a file, a key, a part or a value that the user gave.

    The message is one line that names what was given (file, key, part, value), what is possible, and what to do.
    The command line prints it and exits with code 2.
    """


class CheckFailed(Exception):
    """A check ran and failed.

    The message is the result, as a command would return it; the command line prints it on stdout and exits with code 1.
    """
