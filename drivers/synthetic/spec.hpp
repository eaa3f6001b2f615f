#pragma once

#include <cstdint>
#include <string>

#include "config/result.hpp"
#include "drivers/synthetic/scene.hpp"

namespace stillmap::synthetic {

/// What a `synthetic:` spec asks for.
struct Spec {
  const Scene* scene = nullptr;
  bool without_movers = false;
  uint64_t seed = 1;
  int32_t width = 640;   ///< 64..1920
  int32_t height = 480;  ///< 48..1080
  double seconds = 10;   ///< 0.1..100000
  bool odometry = false;
  bool wheels_slip = false;
};

/// Parses SCENE[,seed=N][,size=WxH][,seconds=S][,odometry=0|1|slip].
Result<Spec> parse_spec(const std::string& text);

}  // namespace stillmap::synthetic
