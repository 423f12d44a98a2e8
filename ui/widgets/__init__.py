"""Small widgets and drawing helpers that any tab can use."""
