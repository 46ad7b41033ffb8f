"""What the user works on, without Qt: document, history, commands, selection, queries."""
