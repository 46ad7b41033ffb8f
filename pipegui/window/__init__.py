"""The shell: main window, docks, views, toolbar, actions, command palette, shortcuts."""
