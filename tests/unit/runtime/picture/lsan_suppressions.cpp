// The leak checker asks for this by name. fontconfig keeps its patterns by encoded pointers that the checker
// cannot follow, so what cairo holds of them until the end of the program looks lost.

extern "C" const char* __lsan_default_suppressions();  // NOLINT(bugprone-reserved-identifier)
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libfontconfig\n";
}  // NOLINT
