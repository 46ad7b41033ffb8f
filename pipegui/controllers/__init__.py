"""What talks to the user and changes the document; controllers own no widgets of the window."""
