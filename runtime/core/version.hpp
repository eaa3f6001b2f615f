#pragma once

namespace stillmap {

/// Version of the project as CMakeLists.txt states it, like "0.1.0".
const char* version();

}  // namespace stillmap
