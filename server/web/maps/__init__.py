"""Map tiles and site images."""
