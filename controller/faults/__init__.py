"""`treadwatch faults`: injects faults and measures how every chassis reacts. It begins in command.py.

The files in the order in which they come into play:

* command.py - the command: runs all faults and prints the tables
* trials.py - faults of base and link, in simulated time
* kills.py - killed or frozen processes, in real time
"""
