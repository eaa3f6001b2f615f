// TUM folders.
