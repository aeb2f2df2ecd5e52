"""`python -m controller` is the command `treadwatch`."""

from controller.cli import main

main()
