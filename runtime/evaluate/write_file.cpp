#include "runtime/evaluate/write_file.hpp"

#include <cerrno>
#include <cstdio>
#include <cstring>

#include <fmt/format.h>

namespace stillmap {

std::optional<Error> write_file_whole(const std::string& path, std::string_view text) {
  const std::string part = path + ".part";
  const auto failed = [&](const char* what) {
    const int reason = errno;
    std::remove(part.c_str());
    return Error{fmt::format("{}: {} failed: {}; check the folder and the space left", path, what,
                             std::strerror(reason))};
  };
  std::FILE* file = std::fopen(part.c_str(), "wb");
  if (file == nullptr) return failed("opening for writing");
  const bool written =
      std::fwrite(text.data(), 1, text.size(), file) == text.size() && std::fflush(file) == 0;
  if (!written) {
    const Error error = failed("writing");
    std::fclose(file);
    return error;
  }
  if (std::fclose(file) != 0) return failed("closing");
  if (std::rename(part.c_str(), path.c_str()) != 0) return failed("renaming into place");
  return std::nullopt;
}

}  // namespace stillmap
