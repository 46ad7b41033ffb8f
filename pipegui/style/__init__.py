"""Theme, colours and colour maps."""
