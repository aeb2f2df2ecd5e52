"""Links that carry bytes, frames or messages, and know nothing of their meaning. See hal/api.py.

reopening.py - base class of CAN and serial links: opens a lost device again
can_bus.py - CAN buses through python-can
serial_port.py - serial ports through pyserial
datagrams.py - messages of other programs, over UDP or a Unix socket
pseudo_terminal.py - a serial line without hardware, for emulators
scripted.py - links in memory that fail on demand, for tests
"""
