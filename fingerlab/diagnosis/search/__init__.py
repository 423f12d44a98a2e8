"""Which effect next, how many, and at which points of their grids."""
