"""The command line: one file per command, in the order of daily use.

    process   captures in, pictures out          simulate   the digital twin: a scene to a DNG
    info      what a bundle or a capture is       check      prove a bundle
    bench     speed against accuracy              doctor     what this machine has
    stress    where the networks stop helping
    freeze, train, export   design time (torch)

`app` joins the commands and turns errors into one line and an exit code (`exit_code`). Shared by
commands: `choices` (options), `mosaic` (headerless mosaics), `progress` (bars and results),
`design_time` (asking for torch, keeping files).
"""

from camkit.cli.app import main

__all__ = ["main"]
