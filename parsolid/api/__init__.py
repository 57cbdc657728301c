"""The Python interface, which the command line calls, too; docs/python.md."""
