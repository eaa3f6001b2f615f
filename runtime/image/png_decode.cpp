#include <spng.h>

#include <cstring>
#include <memory>
#include <vector>

#include "runtime/image/decode.hpp"

namespace stillmap::image {
namespace {

using Context = std::unique_ptr<spng_ctx, decltype(&spng_ctx_free)>;

Error broken(int code) {
  return {std::string("not a whole PNG image: ") + spng_strerror(code)};
}

/// A decoder that reads `bytes` and allocates no more than the limits allow.
Result<Context> open(const std::string& bytes) {
  Context context(spng_ctx_new(0), spng_ctx_free);
  if (!context) return Error{"no memory for the PNG decoder"};
  // A damaged text or time chunk does not spoil the picture.
  spng_set_crc_action(context.get(), SPNG_CRC_ERROR, SPNG_CRC_DISCARD);
  spng_set_image_limits(context.get(), kMaxImageSide, kMaxImageSide);
  spng_set_chunk_limits(context.get(), kMaxImageBytes, kMaxImageBytes);
  if (const int code = spng_set_png_buffer(context.get(), bytes.data(), bytes.size()); code != 0)
    return broken(code);
  return context;
}

Result<Done> decode_contiguous(spng_ctx* context, int format, void* out, size_t out_bytes) {
  size_t needed = 0;
  if (const int code = spng_decoded_image_size(context, format, &needed); code != 0) return broken(code);
  if (needed != out_bytes) return Error{"decodes to another size than its head says"};
  if (const int code = spng_decode_image(context, out, out_bytes, format, 0); code != 0) return broken(code);
  // Reads on to the end, so that a file that was cut behind the pixels is found too.
  if (const int code = spng_decode_chunks(context); code != 0) return broken(code);
  return Done{};
}

template <class Pixel>
Result<Done> decode(const std::string& bytes, int format, ImageView<Pixel> out) {
  const Result<Context> context = open(bytes);
  if (!context) return Error{context.error()};
  const size_t row_bytes = static_cast<size_t>(out.cols) * sizeof(Pixel);
  const size_t all_bytes = row_bytes * static_cast<size_t>(out.rows);
  if (out.pitch == out.cols) return decode_contiguous(context->get(), format, out.data, all_bytes);

  std::vector<uint8_t> pixels(all_bytes);
  Result<Done> done = decode_contiguous(context->get(), format, pixels.data(), all_bytes);
  if (done)
    for (int32_t row = 0; row < out.rows; ++row)
      std::memcpy(static_cast<void*>(out.row(row)), pixels.data() + static_cast<size_t>(row) * row_bytes,
                  row_bytes);
  return done;
}

}  // namespace

Result<ImageInfo> png_info(const std::string& bytes) {
  const Result<Context> context = open(bytes);
  if (!context) return Error{context.error()};
  spng_ihdr head = {};
  if (const int code = spng_get_ihdr(context->get(), &head); code != 0) return broken(code);
  return ImageInfo{static_cast<int32_t>(head.height), static_cast<int32_t>(head.width), head.bit_depth,
                   head.color_type == SPNG_COLOR_TYPE_GRAYSCALE};
}

Result<Done> decode_png16(const std::string& bytes, ImageView<uint16_t> out) {
  return decode(bytes, SPNG_FMT_PNG, out);
}

Result<Done> decode_png_rgb(const std::string& bytes, ImageView<Rgb8> out) {
  return decode(bytes, SPNG_FMT_RGB8, out);
}

}  // namespace stillmap::image
