"""A law for what the catalogue does not explain, drafted from the remainder of the last model."""
