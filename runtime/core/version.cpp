#include "runtime/core/version.hpp"

namespace stillmap {

const char* version() {
  return STILLMAP_VERSION;
}  // given by CMakeLists.txt of this folder

}  // namespace stillmap
