"""What developers run: bench, accuracy study, pictures, translations."""
