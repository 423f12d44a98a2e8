"""What a model fitted to the runs leaves, and what that says."""
