#include <fcntl.h>
#include <spng.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <system_error>
#include <vector>

#include "runtime/image/image_file.hpp"

namespace stillmap {
namespace {

/// Depth and masks pack well enough at a level that keeps up with a camera.
constexpr int kCompressionLevel = 3;

struct FreePng {
  void operator()(void* bytes) const { std::free(bytes); }  // the library allocates with malloc
};

struct Encoded {
  std::unique_ptr<void, FreePng> bytes;
  size_t count = 0;
};

template <class Pixel>
std::vector<uint8_t> rows_together(ImageView<const Pixel> image) {
  const size_t row_bytes = static_cast<size_t>(image.cols) * sizeof(Pixel);
  std::vector<uint8_t> pixels(row_bytes * static_cast<size_t>(image.rows));
  for (int32_t row = 0; row < image.rows; ++row)
    std::memcpy(pixels.data() + static_cast<size_t>(row) * row_bytes, image.row(row), row_bytes);
  return pixels;
}

Result<Encoded> encode(const std::vector<uint8_t>& pixels, spng_ihdr head) {
  const std::unique_ptr<spng_ctx, decltype(&spng_ctx_free)> context(spng_ctx_new(SPNG_CTX_ENCODER),
                                                                    spng_ctx_free);
  if (!context) return Error{"no memory for the PNG encoder"};
  spng_set_option(context.get(), SPNG_ENCODE_TO_BUFFER, 1);
  spng_set_option(context.get(), SPNG_IMG_COMPRESSION_LEVEL, kCompressionLevel);
  spng_set_option(context.get(), SPNG_FILTER_CHOICE, SPNG_FILTER_CHOICE_SUB);
  int code = spng_set_ihdr(context.get(), &head);
  if (code == 0)
    code = spng_encode_image(context.get(), pixels.data(), pixels.size(), SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE);
  Encoded encoded;
  if (code == 0) encoded.bytes.reset(spng_get_png_buffer(context.get(), &encoded.count, &code));
  if (code != 0) return Error{std::string("cannot be encoded: ") + spng_strerror(code)};
  return encoded;
}

/// @return 0, or the system's error number
int write_all(int fd, const char* bytes, size_t count) {
  while (count > 0) {
    const ssize_t put = ::write(fd, bytes, count);
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) return errno;
    bytes += put;
    count -= static_cast<size_t>(put);
  }
  return 0;
}

int write_file(const std::string& path, const Encoded& content) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd < 0) return errno;
  const int failed = write_all(fd, static_cast<const char*>(content.bytes.get()), content.count);
  const int not_closed = ::close(fd) != 0 ? errno : 0;
  return failed ? failed : not_closed;
}

Result<Done> write_aside_and_rename(const std::string& path, const Encoded& content) {
  const std::string aside = path + ".part";
  int failed = write_file(aside, content);
  if (!failed && std::rename(aside.c_str(), path.c_str()) != 0) failed = errno;
  if (!failed) return Done{};
  ::unlink(aside.c_str());
  return Error{path + ": cannot be written: " + std::generic_category().message(failed)};
}

template <class Pixel>
Result<Done> write(const std::string& path, ImageView<const Pixel> image, uint8_t bits, uint8_t colour_type) {
  if (image.rows <= 0 || image.cols <= 0 || image.rows > kMaxImageSide || image.cols > kMaxImageSide)
    return Error{path + ": an image of " + std::to_string(image.cols) + "x" + std::to_string(image.rows) +
                 " pixels cannot be written"};
  spng_ihdr head = {};
  head.width = static_cast<uint32_t>(image.cols);
  head.height = static_cast<uint32_t>(image.rows);
  head.bit_depth = bits;
  head.color_type = colour_type;
  const Result<Encoded> content = encode(rows_together(image), head);
  if (!content) return Error{path + ": " + content.error()};
  return write_aside_and_rename(path, *content);
}

}  // namespace

Result<Done> write_png(const std::string& path, ImageView<const Rgb8> image) {
  return write(path, image, 8, SPNG_COLOR_TYPE_TRUECOLOR);
}

Result<Done> write_png_grey(const std::string& path, ImageView<const uint8_t> image) {
  return write(path, image, 8, SPNG_COLOR_TYPE_GRAYSCALE);
}

Result<Done> write_png16(const std::string& path, ImageView<const uint16_t> image) {
  return write(path, image, 16, SPNG_COLOR_TYPE_GRAYSCALE);
}

}  // namespace stillmap
