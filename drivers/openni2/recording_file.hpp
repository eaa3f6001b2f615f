#pragma once

#include <string>

namespace stillmap::openni2 {

/// Goes through the records of an .oni file, headers only: OpenNI2's player neither notices damage nor ends
/// at it.
/// @return what is wrong with it, naming the file; empty: it is whole   @thread boot
std::string recording_problem(const std::string& path);

}  // namespace stillmap::openni2
