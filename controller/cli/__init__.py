"""The command line `treadwatch`: controller/__main__.py calls main() in commands.py.

* commands.py - run, watch, govern, replay, envelope, emulate; how errors are told
* measuring.py - the commands that measure: bench, evaluate, campaign, stop-and-go, faults
* options.py - options that several commands have in common
* envelope.py - `treadwatch envelope`: what the robot can guarantee
* emulate.py - `treadwatch emulate`: an emulated base in a process of its own

Commands that need more than one file have a package: mission/, watch/, governor/, replay/, bench/,
evaluation/, campaign/, faults/.
"""
