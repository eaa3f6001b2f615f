#include <turbojpeg.h>

#include <memory>

#include "runtime/image/decode.hpp"

namespace stillmap::image {
namespace {

using Decoder = std::unique_ptr<void, decltype(&tjDestroy)>;

Decoder make_decoder() {
  return {tjInitDecompress(), tjDestroy};
}

Error broken(const Decoder& decoder) {
  return {std::string("not a whole JPEG image: ") + (decoder ? tjGetErrorStr2(decoder.get()) : "no memory")};
}

const unsigned char* data_of(const std::string& bytes) {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}

Result<ImageInfo> read_head(const Decoder& decoder, const std::string& bytes) {
  int width = 0, height = 0, subsampling = 0, colour_space = 0;
  if (!decoder || tjDecompressHeader3(decoder.get(), data_of(bytes), bytes.size(), &width, &height,
                                      &subsampling, &colour_space) != 0)
    return broken(decoder);
  if (width > kMaxImageSide || height > kMaxImageSide)
    return Error{"image of " + std::to_string(width) + "x" + std::to_string(height) + " pixels; at most " +
                 std::to_string(kMaxImageSide) + " each way are read"};
  return ImageInfo{height, width, 8, colour_space == TJCS_GRAY};
}

}  // namespace

Result<ImageInfo> jpeg_info(const std::string& bytes) {
  return read_head(make_decoder(), bytes);
}

Result<Done> decode_jpeg_rgb(const std::string& bytes, ImageView<Rgb8> out) {
  const Decoder decoder = make_decoder();
  if (const Result<ImageInfo> head = read_head(decoder, bytes); !head) return Error{head.error()};
  // A cut file is only a warning to the library, which would fill the rest with grey.
  const int flags = TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS;
  const int failed =
      tjDecompress2(decoder.get(), data_of(bytes), bytes.size(), reinterpret_cast<unsigned char*>(out.data),
                    out.cols, out.pitch * static_cast<int>(sizeof(Rgb8)), out.rows, TJPF_RGB, flags);
  if (failed) return broken(decoder);
  return Done{};
}

}  // namespace stillmap::image
