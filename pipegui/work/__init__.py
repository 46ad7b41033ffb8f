"""What runs in the background: worker, job queue, previews, kernel warm-up, crash guard."""
