// PNG files.
