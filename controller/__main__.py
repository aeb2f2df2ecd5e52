"""The command `treadwatch`, also as `python -m controller`.

Imports nothing that takes time before it is ready for Ctrl-C.
"""

import sys

from controller.errors import INTERRUPTED


def main() -> None:
    """The whole program; Ctrl-C where no command makes more of it is one line and exit code 130."""
    try:
        from controller.cli.commands import main as run_command

        run_command()
    except KeyboardInterrupt:
        sys.stderr.write("treadwatch: interrupted\n")
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()
