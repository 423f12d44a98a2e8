"""What drives and reads the bench: one small protocol, and the devices behind it."""
