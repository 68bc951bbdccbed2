"""Entry of `python -m s2a` and of the command `s2a`."""

import sys


def main() -> int:
    """Run the command line; an interrupt while it is imported, which takes half a second, is one line, too."""
    try:
        from s2a.commands import cli  # here, so that an interrupt meanwhile is caught

        return cli.main()
    except KeyboardInterrupt:
        sys.stderr.write("s2a: interrupted\n")
        return 130


if __name__ == "__main__":
    sys.exit(main())
