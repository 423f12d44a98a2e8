"""What the bench is told to do, and how it is recorded."""
