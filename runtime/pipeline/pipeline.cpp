// One frame.
