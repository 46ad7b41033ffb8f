"""The project file: format, codec, validation, reference to the clouds."""
