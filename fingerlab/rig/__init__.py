"""What the bench is: constants with tolerances, channels, limits; the TOML file that holds them."""
