"""The project file: format, codec, reference to the clouds."""
