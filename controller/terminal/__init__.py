"""What the user of a drive or a replay sees on the terminal.

* outlet.py - the standard streams; a reader that stops neither blocks nor ends a drive
* console.py - progress line, events, warnings, summary
"""
