// Rendered rooms.
