"""From the ring to a session's file."""
