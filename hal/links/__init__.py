"""Links behind hal.api.Link: whole messages, and nothing of what they mean.

can_bus (python-can), serial_port (pyserial), datagrams (other programs). reopening comes around the first two
and opens them again once they are lost; pseudo_terminal is a serial line without hardware; scripted is for
tests, and fails on demand.
"""
