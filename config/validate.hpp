#pragma once

#include <string>
#include <vector>

#include "config/config.hpp"
#include "kernels/base/pinhole.hpp"

namespace stillmap {

/// Everything that is wrong with a configuration: each range of the `fields` lists, each rule between keys,
/// each part that this build lacks. One line each, with key, value and limit; empty when all is well.
/// @thread boot
std::vector<std::string> violations(const Config& config);

/// What is wrong with a camera: not finite, focal length not above 0, centre outside the image.
/// The size is looked at only where it is known (width and height above 0).
/// @return one line without the name of a file; empty when all is well
std::string camera_problem(const CameraModel& camera);

}  // namespace stillmap
