"""Gates: what a fitted proposal must show to be an element."""
