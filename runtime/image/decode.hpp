#pragma once

// Inside runtime/image: one decoder a file format. Messages are without the name of the file.

#include <string>

#include "config/result.hpp"
#include "kernels/base/view.hpp"
#include "runtime/image/image_file.hpp"

namespace stillmap::image {

Result<ImageInfo> png_info(const std::string& bytes);
/// @param out the whole image; its size is that of the file
Result<Done> decode_png16(const std::string& bytes, ImageView<uint16_t> out);
Result<Done> decode_png_rgb(const std::string& bytes, ImageView<Rgb8> out);

Result<ImageInfo> jpeg_info(const std::string& bytes);
Result<Done> decode_jpeg_rgb(const std::string& bytes, ImageView<Rgb8> out);

}  // namespace stillmap::image
