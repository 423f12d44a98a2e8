"""A fitted model: its file, and the model beside a running motor."""
