"""Links: CAN through python-can, serial through pyserial, and scripted ones that misbehave."""
