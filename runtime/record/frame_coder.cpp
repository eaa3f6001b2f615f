#include "runtime/record/frame_coder.hpp"

#include <turbojpeg.h>
#include <zstd.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#include "runtime/core/crc32c.hpp"

namespace stillmap {
namespace {

static_assert(std::endian::native == std::endian::little, "depth is logged as it lies in memory");

constexpr int kPackLevel = 1;
constexpr int kJpegQuality = 90;
constexpr int kJpegSampling = TJSAMP_420;
constexpr uint64_t kPackerBytes = 3 << 20;  ///< of zstd at level 1 for images of this size, measured
constexpr size_t kChannels = 3;

size_t pixels_of(int32_t rows, int32_t cols) {
  return static_cast<size_t>(rows) * static_cast<size_t>(cols);
}

/// One plane after the other: green, red - green, blue - green; each the difference from the pixel before.
void to_differences(const ImageView<Rgb8>& colour, uint8_t* to) {
  const size_t pixels = pixels_of(colour.rows, colour.cols);
  uint8_t *green = to, *red = to + pixels, *blue = to + 2 * pixels;
  uint8_t last_g = 0, last_r = 0, last_b = 0;
  for (int32_t row = 0; row < colour.rows; ++row) {
    const Rgb8* const from = colour.row(row);
    for (int32_t col = 0; col < colour.cols; ++col) {
      const uint8_t g = from[col].g;
      const auto r = static_cast<uint8_t>(from[col].r - g), b = static_cast<uint8_t>(from[col].b - g);
      *green++ = static_cast<uint8_t>(g - last_g);
      *red++ = static_cast<uint8_t>(r - last_r);
      *blue++ = static_cast<uint8_t>(b - last_b);
      last_g = g;
      last_r = r;
      last_b = b;
    }
  }
}

void from_differences(const uint8_t* from, const ImageView<Rgb8>& colour) {
  const size_t pixels = pixels_of(colour.rows, colour.cols);
  const uint8_t *green = from, *red = from + pixels, *blue = from + 2 * pixels;
  uint8_t g = 0, r = 0, b = 0;
  for (int32_t row = 0; row < colour.rows; ++row) {
    Rgb8* const to = colour.row(row);
    for (int32_t col = 0; col < colour.cols; ++col) {
      g = static_cast<uint8_t>(g + *green++);
      r = static_cast<uint8_t>(r + *red++);
      b = static_cast<uint8_t>(b + *blue++);
      to[col] = {static_cast<uint8_t>(r + g), g, static_cast<uint8_t>(b + g)};
    }
  }
}

}  // namespace

uint32_t checksum_of(const FrameMessage& m) {
  const auto of_number = [](int64_t number, uint32_t before) {
    uint8_t bytes[8];
    for (int i = 0; i < 8; ++i)
      bytes[i] = static_cast<uint8_t>(static_cast<uint64_t>(number) >> (56 - 8 * i));
    return crc32c(bytes, sizeof bytes, before);
  };
  uint32_t sum = crc32c(m.colour.data, m.colour.size, crc32c(m.depth.data, m.depth.size));
  for (const int64_t number : {m.depth_stamp.ns, m.colour_stamp.ns, int64_t{m.sequence},
                               static_cast<int64_t>(m.depth_coding), static_cast<int64_t>(m.colour_coding)})
    sum = of_number(number, sum);
  return sum;
}

/// One packer an image: its memory fits after the first and stays as it is.
struct FrameEncoder::Packers {
  ZSTD_CCtx* depth = ZSTD_createCCtx();
  ZSTD_CCtx* colour = ZSTD_createCCtx();
  tjhandle jpeg = tjInitCompress();

  Packers() = default;
  ~Packers() {
    ZSTD_freeCCtx(depth);
    ZSTD_freeCCtx(colour);
    if (jpeg) tjDestroy(jpeg);
  }
  Packers(const Packers&) = delete;
  Packers& operator=(const Packers&) = delete;
};

FrameEncoder::FrameEncoder(int32_t rows, int32_t cols, ImageCoding colour)
    : rows_(rows), cols_(cols), colour_(colour), packers_(std::make_unique<Packers>()) {
  const size_t pixels = pixels_of(rows, cols);
  plain_.resize(kChannels * pixels);
  depth_packed_.resize(ZSTD_compressBound(sizeof(uint16_t) * pixels));
  colour_packed_.resize(colour == ImageCoding::jpeg ? tjBufSize(cols, rows, kJpegSampling)
                                                    : ZSTD_compressBound(kChannels * pixels));
  for (ZSTD_CCtx* packer : {packers_->depth, packers_->colour})
    ZSTD_CCtx_setParameter(packer, ZSTD_c_compressionLevel, kPackLevel);
  // The packers take their memory with the first image: now.
  ZSTD_compress2(packers_->depth, depth_packed_.data(), depth_packed_.size(), plain_.data(),
                 sizeof(uint16_t) * pixels);
  if (colour == ImageCoding::zstd_colour)
    ZSTD_compress2(packers_->colour, colour_packed_.data(), colour_packed_.size(), plain_.data(),
                   plain_.size());
}

FrameEncoder::~FrameEncoder() = default;

uint64_t FrameEncoder::planned_bytes(int32_t rows, int32_t cols) {
  const size_t pixels = pixels_of(rows, cols);
  return kChannels * pixels + ZSTD_compressBound(sizeof(uint16_t) * pixels) +
         ZSTD_compressBound(kChannels * pixels) + 2 * kPackerBytes;
}

Status FrameEncoder::encode(const RgbdFrame& frame, FrameMessage& message) {
  const auto right_size = [&](const auto& image) { return image.rows == rows_ && image.cols == cols_; };
  if (!right_size(frame.depth_raw) || !right_size(frame.colour)) return Status::bad_data;
  const uint32_t depth = pack_depth(frame.depth_raw);
  const uint32_t colour = colour_ == ImageCoding::jpeg ? pack_jpeg(frame.colour) : pack_colour(frame.colour);
  if (depth == 0 || colour == 0) return Status::bad_data;
  message.depth_stamp = frame.depth_stamp;
  message.colour_stamp = frame.colour_stamp;
  message.sequence = frame.sequence;
  message.depth_coding = ImageCoding::zstd_depth;
  message.colour_coding = colour_;
  message.depth = {depth_packed_.data(), depth};
  message.colour = {colour_packed_.data(), colour};
  message.crc32c = checksum_of(message);
  return Status::ok;
}

uint32_t FrameEncoder::pack_depth(const ImageView<uint16_t>& depth) {
  const size_t row_bytes = sizeof(uint16_t) * static_cast<size_t>(cols_);
  for (int32_t row = 0; row < rows_; ++row)
    std::memcpy(plain_.data() + static_cast<size_t>(row) * row_bytes, depth.row(row), row_bytes);
  const size_t packed = ZSTD_compress2(packers_->depth, depth_packed_.data(), depth_packed_.size(),
                                       plain_.data(), static_cast<size_t>(rows_) * row_bytes);
  return ZSTD_isError(packed) ? 0 : static_cast<uint32_t>(packed);
}

uint32_t FrameEncoder::pack_colour(const ImageView<Rgb8>& colour) {
  to_differences(colour, plain_.data());
  const size_t packed = ZSTD_compress2(packers_->colour, colour_packed_.data(), colour_packed_.size(),
                                       plain_.data(), plain_.size());
  return ZSTD_isError(packed) ? 0 : static_cast<uint32_t>(packed);
}

uint32_t FrameEncoder::pack_jpeg(const ImageView<Rgb8>& colour) {
  unsigned char* to = colour_packed_.data();
  unsigned long bytes = colour_packed_.size();
  const int failed = tjCompress2(packers_->jpeg, reinterpret_cast<const unsigned char*>(colour.data), cols_,
                                 colour.pitch * static_cast<int>(sizeof(Rgb8)), rows_, TJPF_RGB, &to, &bytes,
                                 kJpegSampling, kJpegQuality, TJFLAG_NOREALLOC);
  return failed ? 0 : static_cast<uint32_t>(bytes);
}

struct FrameDecoder::Unpackers {
  ZSTD_DCtx* zstd = ZSTD_createDCtx();
  tjhandle jpeg = tjInitDecompress();

  Unpackers() = default;
  ~Unpackers() {
    ZSTD_freeDCtx(zstd);
    if (jpeg) tjDestroy(jpeg);
  }
  Unpackers(const Unpackers&) = delete;
  Unpackers& operator=(const Unpackers&) = delete;
};

FrameDecoder::FrameDecoder() : unpackers_(std::make_unique<Unpackers>()) {}
FrameDecoder::~FrameDecoder() = default;
FrameDecoder::FrameDecoder(FrameDecoder&&) noexcept = default;
FrameDecoder& FrameDecoder::operator=(FrameDecoder&&) noexcept = default;

Status FrameDecoder::refused(std::string why) {
  error_ = std::move(why);
  return Status::bad_data;
}

Status FrameDecoder::decode(const FrameMessage& message, RgbdFrame& frame) {
  if (checksum_of(message) != message.crc32c) return refused("the checksum is wrong: the log is damaged");
  if (message.depth_coding != ImageCoding::zstd_depth)
    return refused("depth is in a coding that this program does not know");
  const ImageView<uint16_t>& depth = frame.depth_raw;
  const size_t row_bytes = sizeof(uint16_t) * static_cast<size_t>(depth.cols);
  const size_t depth_bytes = static_cast<size_t>(depth.rows) * row_bytes;
  plain_.resize(std::max(plain_.size(), kChannels * pixels_of(depth.rows, depth.cols)));
  const size_t got = ZSTD_decompressDCtx(unpackers_->zstd, plain_.data(), depth_bytes, message.depth.data,
                                         message.depth.size);
  if (got != depth_bytes) return refused("depth is no image of the session's size");
  for (int32_t row = 0; row < depth.rows; ++row)
    std::memcpy(depth.row(row), plain_.data() + static_cast<size_t>(row) * row_bytes, row_bytes);
  if (!unpack_colour(message, frame.colour))
    return refused("colour is no image of the session's size, or in an unknown coding");
  frame.depth_stamp = message.depth_stamp;
  frame.colour_stamp = message.colour_stamp;
  frame.sequence = message.sequence;
  return Status::ok;
}

bool FrameDecoder::unpack_colour(const FrameMessage& message, const ImageView<Rgb8>& colour) {
  if (message.colour_coding == ImageCoding::zstd_colour) {
    const size_t bytes = kChannels * pixels_of(colour.rows, colour.cols);
    if (ZSTD_decompressDCtx(unpackers_->zstd, plain_.data(), bytes, message.colour.data,
                            message.colour.size) != bytes)
      return false;
    from_differences(plain_.data(), colour);
    return true;
  }
  if (message.colour_coding != ImageCoding::jpeg) return false;
  int width = 0, height = 0, sampling = 0, space = 0;
  if (tjDecompressHeader3(unpackers_->jpeg, message.colour.data, message.colour.size, &width, &height,
                          &sampling, &space) != 0 ||
      width != colour.cols || height != colour.rows)
    return false;
  return tjDecompress2(unpackers_->jpeg, message.colour.data, message.colour.size,
                       reinterpret_cast<unsigned char*>(colour.data), colour.cols,
                       colour.pitch * static_cast<int>(sizeof(Rgb8)), colour.rows, TJPF_RGB,
                       TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS) == 0;
}

}  // namespace stillmap
