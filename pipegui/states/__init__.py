"""What the views show, frozen: `resolve(document)`."""
