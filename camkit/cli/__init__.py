"""The command line: one file per command, in the order of daily use.

    process   captures in, pictures out          simulate   the digital twin: a scene to a DNG
    info      what a bundle or a capture is       check      prove a bundle
    doctor    what this machine has               freeze, train, export   design time (torch)

`app` joins the commands and turns camkit's errors into one line and an exit code.
"""

from camkit.cli.app import main

__all__ = ["main"]
