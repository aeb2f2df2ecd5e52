"""The program: command line, composition, runners, decide, shape, path following, service."""
