"""What runs beside the window: worker, job queue, previews, kernel warm-up, crash guard."""
