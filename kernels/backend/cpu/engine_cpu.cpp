// The CPU engine (see engine.hpp).
#include "kernels/engine.hpp"
