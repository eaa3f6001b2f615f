// Absolute trajectory error.
