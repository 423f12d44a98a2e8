"""What a person is told: numbers, curves and words."""
