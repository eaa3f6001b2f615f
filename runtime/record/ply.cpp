// PLY files.
