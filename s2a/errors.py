"""The one error that a user can mend, and the verdict that is no error."""


class InputError(ValueError):
    """Bad input: a file, a key, a part or a value that the user gave.

    The message is one line that names what was given (file, key, part, value), what would have been possible, and what to do.
    The command line prints it and exits with code 2.
    """


class NotPassed(Exception):
    """What was asked was found out, and the answer is no.

    The message is the result, as a verb would return it; the command line prints it on stdout and exits with code 1.
    """
