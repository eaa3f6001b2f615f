#include <string_view>

#include "config/read_file.hpp"
#include "runtime/image/decode.hpp"
#include "runtime/image/image_file.hpp"

namespace stillmap {
namespace {

enum class Format { png, jpeg, unknown };

Format format_of(std::string_view bytes) {
  if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return Format::png;
  if (bytes.starts_with("\xff\xd8\xff")) return Format::jpeg;
  return Format::unknown;
}

std::string size_text(int32_t cols, int32_t rows) {
  return std::to_string(cols) + "x" + std::to_string(rows) + " pixels";
}

std::string kind_text(const ImageInfo& info) {
  return std::to_string(info.bits) + "-bit " + (info.grey ? "grey" : "colour");
}

Result<ImageInfo> info_of(const std::string& bytes) {
  switch (format_of(bytes)) {
    case Format::png:
      return image::png_info(bytes);
    case Format::jpeg:
      return image::jpeg_info(bytes);
    case Format::unknown:
      break;
  }
  return Error{bytes.empty() ? "an empty file" : "neither a PNG nor a JPEG image"};
}

Error about(const std::string& path, const std::string& problem) {
  return {path + ": " + problem};
}

/// Bytes of the file, once its head says that it has the size of the destination.
template <class Pixel>
Result<std::string> read_of_size(const std::string& path, ImageView<Pixel> out, ImageInfo& info) {
  Result<std::string> bytes = read_file(path, kMaxImageBytes);
  if (!bytes) return bytes;
  const Result<ImageInfo> head = info_of(*bytes);
  if (!head) return about(path, head.error());
  info = *head;
  if (info.cols != out.cols || info.rows != out.rows)
    return about(path,
                 "expected " + size_text(out.cols, out.rows) + ", found " + size_text(info.cols, info.rows));
  return bytes;
}

}  // namespace

Result<ImageInfo> image_info(const std::string& path) {
  const Result<std::string> bytes = read_file(path, kMaxImageBytes);
  if (!bytes) return Error{bytes.error()};
  Result<ImageInfo> info = info_of(*bytes);
  if (!info) return about(path, info.error());
  return info;
}

Result<Done> read_png16(const std::string& path, ImageView<uint16_t> out) {
  ImageInfo info;
  const Result<std::string> bytes = read_of_size(path, out, info);
  if (!bytes) return Error{bytes.error()};
  if (info.bits != 16 || !info.grey)
    return about(path, "expected a depth image of 16-bit grey (PNG), found " + kind_text(info));
  const Result<Done> done = image::decode_png16(*bytes, out);
  if (!done) return about(path, done.error());
  return done;
}

Result<Done> read_colour(const std::string& path, ImageView<Rgb8> out) {
  ImageInfo info;
  const Result<std::string> bytes = read_of_size(path, out, info);
  if (!bytes) return Error{bytes.error()};
  if (info.bits > 8)
    return about(path, "expected a colour image of 8 bits a channel, found " + kind_text(info) +
                           (info.grey ? "; is this the depth image?" : ""));
  const Result<Done> done = format_of(*bytes) == Format::png ? image::decode_png_rgb(*bytes, out)
                                                             : image::decode_jpeg_rgb(*bytes, out);
  if (!done) return about(path, done.error());
  return done;
}

}  // namespace stillmap
